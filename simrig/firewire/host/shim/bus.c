#define _GNU_SOURCE
#include "bus.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>

#include "real.h"

/* If the bus does not answer for so long, the shim treats it as unplugged, so that no caller waits for ever. */
#define PATIENCE_S 10

bool bus_configured(void) {
    const char *name = getenv(BUS_VARIABLE);
    return name != NULL && name[0] != '\0';
}

static int refuse(int connection, int error) {
    REAL(close)(connection);
    errno = error;
    return -1;
}

int bus_connect(void) {
    const char *name = getenv(BUS_VARIABLE);
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    size_t length = name == NULL ? 0 : strlen(name);
    if (length == 0 || length >= sizeof address.sun_path) {
        errno = ENOENT;
        return -1;
    }
    memcpy(address.sun_path, name, length);
    if (address.sun_path[0] == '@')
        address.sun_path[0] = '\0'; /* abstract: the length ends the name, not a NUL */
    int connection = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
    if (connection < 0)
        return -1;
    struct timeval patience = {.tv_sec = PATIENCE_S};
    if (setsockopt(connection, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience) < 0 ||
        setsockopt(connection, SOL_SOCKET, SO_SNDTIMEO, &patience, sizeof patience) < 0 ||
        connect(connection, (struct sockaddr *)&address, (socklen_t)(offsetof(struct sockaddr_un, sun_path) + length)) < 0)
        return refuse(connection, errno);
    return connection;
}

static bool append(struct request *request, uint32_t *count, const void *data, size_t bytes) {
    size_t used = request->argument_bytes + request->extra_bytes;
    if (bytes > sizeof request->payload - used)
        return false;
    if (bytes > 0)
        memcpy(request->payload + used, data, bytes);
    *count += (uint32_t)bytes;
    return true;
}

bool request_argument(struct request *request, const void *data, size_t bytes) {
    return append(request, &request->argument_bytes, data, bytes);
}

bool request_extra(struct request *request, const void *data, size_t bytes) {
    return append(request, &request->extra_bytes, data, bytes);
}

static bool send_request(int connection, const struct request *request, int descriptor) {
    size_t bytes = offsetof(struct request, payload) + request->argument_bytes + request->extra_bytes;
    struct iovec part = {.iov_base = (void *)(uintptr_t)request, .iov_len = bytes};
    union {
        struct cmsghdr head; /* for its alignment */
        char bytes[CMSG_SPACE(sizeof(int))];
    } ancillary = {0};
    struct msghdr message = {.msg_iov = &part, .msg_iovlen = 1};
    if (descriptor >= 0) {
        message.msg_control = ancillary.bytes;
        message.msg_controllen = sizeof ancillary.bytes;
        struct cmsghdr *head = CMSG_FIRSTHDR(&message);
        head->cmsg_level = SOL_SOCKET;
        head->cmsg_type = SCM_RIGHTS;
        head->cmsg_len = CMSG_LEN(sizeof(int));
        memcpy(CMSG_DATA(head), &descriptor, sizeof descriptor);
    }
    ssize_t sent;
    do
        sent = sendmsg(connection, &message, MSG_NOSIGNAL);
    while (sent < 0 && errno == EINTR);
    return sent == (ssize_t)bytes;
}

int bus_exchange(int connection, const struct request *request, int descriptor, struct reply *reply) {
    ssize_t received = -1;
    if (send_request(connection, request, descriptor)) {
        do
            received = recv(connection, reply, sizeof *reply, 0);
        while (received < 0 && errno == EINTR);
    }
    const ssize_t head = offsetof(struct reply, payload);
    if (received < head || received - head != (ssize_t)reply->argument_bytes + (ssize_t)reply->extra_bytes) {
        /* The bus is gone or was silent for too long. No later request may take a late reply for its own. */
        shutdown(connection, SHUT_RDWR);
        return -ENODEV;
    }
    return reply->result;
}
