/* Emulated GPIO chips: a socket named gpiochipN looks like a character device of the GPIO subsystem.
 *
 * Of the kernel's interface (linux/gpio.h, version 2) there is what a program needs that makes pulses or waits for edges:
 * information on chip and lines, requests of lines, values, edge events. The chip is a process that listens at the
 * socket (simrig/gpio/chip.py). An open chip is a connection to it, and every ioctl an exchange. A requested line is one
 * end of a socket pair: the chip sends edge events into it, so that poll() and read() need no emulation, and sees its end
 * when the program closes it or dies. Output values go the other way, with the time at which they were set, and are not
 * answered: setting a line takes no longer than a real one would. Levels are read from a file in memory that the chip keeps
 * up to date, one byte for each line: reading takes no longer either.
 */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <linux/gpio.h>
#include <poll.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <sys/time.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

#include "open.h"
#include "real.h"

#define MAX_DESCRIPTORS 4096
#define MAX_BYTES 1024
#define MAJOR 254
/* A chip that does not answer for so long counts as unplugged. */
#define PATIENCE_S 10
/* The request by which a chip learns that it is opened; no ioctl has this code. */
#define OPENED 0

enum kind { NONE, CHIP, LINE };

static atomic_int kinds[MAX_DESCRIPTORS];

/* Of the descriptor of a line: where its level stands. Written before the descriptor becomes a LINE. */
static struct {
    int file; /* one byte for each line of the chip: 1 is high */
    off_t offset;
    int active_low;
} levels[MAX_DESCRIPTORS];

struct message {
    uint32_t code; /* of a request: of the ioctl; of a reply: 0 or an error number */
    uint32_t bytes;
    char payload[MAX_BYTES];
};

struct edge {
    uint64_t time_ns, bits, mask;
};

static enum kind kind_of(int descriptor) {
    return descriptor < 0 || descriptor >= MAX_DESCRIPTORS ? NONE : (enum kind)atomic_load(&kinds[descriptor]);
}

static int fail(int error) {
    errno = error;
    return -1;
}

/* ---- what the chip looks like ---- */

/* Number of the chip whose path this can be; -1: of none. */
static int chip_number(const char *path) {
    const char *name = path == NULL ? NULL : strrchr(path, '/');
    int number, end = 0;
    if (name == NULL || sscanf(name, "/gpiochip%5d%n", &number, &end) != 1 || name[end] != '\0')
        return -1;
    return number;
}

static int disguise(const char *path, int result, struct stat *status) {
    int number = result == 0 && S_ISSOCK(status->st_mode) ? chip_number(path) : -1;
    if (number >= 0) {
        status->st_mode = (status->st_mode & ~(mode_t)S_IFMT) | S_IFCHR;
        status->st_rdev = makedev(MAJOR, (unsigned)number);
    }
    return result;
}

SHIM int stat(const char *path, struct stat *status) {
    return disguise(path, REAL(stat)(path, status), status);
}

SHIM int lstat(const char *path, struct stat *status) {
    return disguise(path, REAL(lstat)(path, status), status);
}

/* The names that programs compiled with an older libc use. */
int __xstat(int version, const char *path, struct stat *status);
int __lxstat(int version, const char *path, struct stat *status);

SHIM int __xstat(int version, const char *path, struct stat *status) {
    return disguise(path, REAL(__xstat)(version, path, status), status);
}

SHIM int __lxstat(int version, const char *path, struct stat *status) {
    return disguise(path, REAL(__lxstat)(version, path, status), status);
}

/* libgpiod asks sysfs whether the device is one of the GPIO subsystem. */
SHIM char *realpath(const char *path, char *resolved) {
    unsigned major, minor;
    int end = 0;
    if (path == NULL || sscanf(path, "/sys/dev/char/%u:%u/subsystem%n", &major, &minor, &end) != 2 || end == 0 ||
        major != MAJOR)
        return REAL(realpath)(path, resolved);
    const char *subsystem = "/sys/bus/gpio";
    return resolved == NULL ? strdup(subsystem) : strcpy(resolved, subsystem);
}

/* ---- exchanges with the chip ---- */

/* Descriptors that come along with the reply to a request: of the line, and of the levels. */
enum { LINE_END, LEVELS, GIVEN };

/* Sends a request and waits for the reply, which takes its place; descriptors that come along go into `given`.
 * Returns 0 or an error number. */
static int exchange(int connection, struct message *message, int given[GIVEN]) {
    size_t bytes = offsetof(struct message, payload) + message->bytes;
    ssize_t received = -1;
    struct iovec part = {.iov_base = message, .iov_len = sizeof *message};
    union {
        struct cmsghdr head; /* for its alignment */
        char bytes[CMSG_SPACE(GIVEN * sizeof(int))];
    } ancillary = {0};
    struct msghdr whole = {
        .msg_iov = &part, .msg_iovlen = 1, .msg_control = ancillary.bytes, .msg_controllen = sizeof ancillary.bytes};
    if (send(connection, message, bytes, MSG_NOSIGNAL) == (ssize_t)bytes)
        do
            received = recvmsg(connection, &whole, MSG_CMSG_CLOEXEC);
        while (received < 0 && errno == EINTR);
    if (received != (ssize_t)(offsetof(struct message, payload) + message->bytes))
        return ENODEV;
    struct cmsghdr *head = CMSG_FIRSTHDR(&whole);
    if (head != NULL && head->cmsg_type == SCM_RIGHTS && head->cmsg_len == CMSG_LEN(GIVEN * sizeof(int)))
        memcpy(given, CMSG_DATA(head), GIVEN * sizeof(int));
    return (int)message->code;
}

static int open_chip(const char *path) {
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    struct timeval patience = {.tv_sec = PATIENCE_S};
    struct message message = {.code = OPENED};
    if (strlen(path) >= sizeof address.sun_path)
        return fail(ENAMETOOLONG);
    strcpy(address.sun_path, path);
    int connection = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0), none[GIVEN], error = 0;
    if (connection < 0)
        return -1;
    setsockopt(connection, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    if (connection >= MAX_DESCRIPTORS)
        error = EMFILE;
    else if (connect(connection, (struct sockaddr *)&address, sizeof address) < 0)
        error = errno == ECONNREFUSED ? ENODEV : errno;
    else
        error = exchange(connection, &message, none);
    if (error != 0) {
        REAL(close)(connection);
        return fail(error);
    }
    atomic_store(&kinds[connection], CHIP);
    return connection;
}

int svev_open(const char *path, int flags, mode_t mode) {
    struct stat status;
    if (chip_number(path) >= 0 && REAL(stat)(path, &status) == 0 && S_ISSOCK(status.st_mode))
        return open_chip(path);
    return REAL(open)(path, flags, mode);
}

SHIM int close(int descriptor) {
    enum kind kind = kind_of(descriptor);
    if (kind != NONE)
        atomic_store(&kinds[descriptor], NONE);
    if (kind == LINE)
        REAL(close)(levels[descriptor].file);
    return REAL(close)(descriptor);
}

/* ---- ioctl ---- */

static int chip_ioctl(int connection, unsigned code, void *argument) {
    size_t bytes = _IOC_SIZE(code);
    struct message message = {.code = code, .bytes = (uint32_t)bytes};
    int given[GIVEN] = {-1, -1}, line;
    if (bytes > sizeof message.payload)
        return fail(ENOTTY);
    memcpy(message.payload, argument, bytes);
    int error = exchange(connection, &message, given);
    line = given[LINE_END];
    if (error == 0 && line >= MAX_DESCRIPTORS) {
        REAL(close)(line);
        REAL(close)(given[LEVELS]);
        error = EMFILE;
    }
    if (error != 0)
        return fail(error);
    if (message.bytes == bytes)
        memcpy(argument, message.payload, bytes);
    if (line >= 0) {
        struct gpio_v2_line_request *request = argument;
        levels[line].file = given[LEVELS];
        levels[line].offset = request->offsets[0];
        levels[line].active_low = (request->config.flags & GPIO_V2_LINE_FLAG_ACTIVE_LOW) != 0;
        atomic_store(&kinds[line], LINE);
        request->fd = line;
    }
    return 0;
}

static int set_values(int line, const struct gpio_v2_line_values *values) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    struct edge edge = {
        .time_ns = (uint64_t)now.tv_sec * 1000000000u + (uint64_t)now.tv_nsec, .bits = values->bits, .mask = values->mask};
    ssize_t sent;
    do
        sent = send(line, &edge, sizeof edge, MSG_NOSIGNAL);
    while (sent < 0 && errno == EINTR);
    return sent == (ssize_t)sizeof edge ? 0 : fail(ENODEV); /* as the kernel does when the chip is unplugged */
}

static int get_values(int line, struct gpio_v2_line_values *values) {
    struct pollfd end = {.fd = line};
    char high;
    if (poll(&end, 1, 0) < 0 || (end.revents & (POLLHUP | POLLERR)) != 0 ||
        pread(levels[line].file, &high, 1, levels[line].offset) != 1)
        return fail(ENODEV);
    values->bits = values->mask & (unsigned)(high != levels[line].active_low);
    return 0;
}

static int line_ioctl(int line, unsigned code, void *argument) {
    switch (code) {
    case GPIO_V2_LINE_SET_VALUES_IOCTL:
        return set_values(line, argument);
    case GPIO_V2_LINE_GET_VALUES_IOCTL:
        return get_values(line, argument);
    default:
        return fail(ENOTTY);
    }
}

SHIM int ioctl(int descriptor, unsigned long code, ...) {
    va_list arguments;
    va_start(arguments, code);
    void *argument = va_arg(arguments, void *);
    va_end(arguments);
    switch (kind_of(descriptor)) {
    case CHIP:
        return chip_ioctl(descriptor, (unsigned)code, argument);
    case LINE:
        return line_ioctl(descriptor, (unsigned)code, argument);
    default:
        return REAL(ioctl)(descriptor, code, argument);
    }
}
