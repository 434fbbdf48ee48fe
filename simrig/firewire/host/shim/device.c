/* An emulated /dev/fw*: open, close, read, mmap and ioctl of the kernel's firewire-cdev interface (API version 3 and up).
 *
 * The program's descriptor is one end of a socket pair, and the bus process sends events into the other end. So poll(),
 * select() and read() need no emulation. Ioctls use a connection of their own. Calls for other descriptors go straight to
 * libc, without a lock; for them open(), read() and close() remain usable in signal handlers.
 *
 * dup() and inheritance by exec() are not emulated: no program that opens /dev/fw* needs them.
 */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <linux/firewire-cdev.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <unistd.h>

#include "bus.h"
#include "nodes.h"
#include "open.h"
#include "real.h"

#define MAX_DESCRIPTORS 4096
#define EVENT_BUFFER_BYTES (1 << 20)
#define WRITE_QUADLET 0
#define WRITE_BLOCK 1
#define LOCK_REQUEST 9

/* State of an open node, by its descriptor. Entries are never freed: a thread that comes late reads `is_open` as false. */
struct device {
    atomic_bool is_open;
    pthread_mutex_t lock; /* guards the other fields, and one exchange at a time */
    int connection;
    char *ring; /* memory for received frames, NULL until mapped */
    size_t ring_bytes;
};

static struct device devices[MAX_DESCRIPTORS]; /* all zero means closed, with usable mutexes */

static struct device *device_of(int descriptor) {
    if (descriptor < 0 || descriptor >= MAX_DESCRIPTORS || !atomic_load(&devices[descriptor].is_open))
        return NULL;
    return &devices[descriptor];
}

/* Locks an open device; false, with errno, if it was closed meanwhile. */
static bool lock_device(struct device *device) {
    pthread_mutex_lock(&device->lock);
    if (atomic_load(&device->is_open))
        return true;
    pthread_mutex_unlock(&device->lock);
    errno = EBADF;
    return false;
}

static int fail(int error) {
    errno = error;
    return -1;
}

/* ---- open, close ---- */

/* Announces the new file to the bus and sends it `events`. Returns 0 or a negative error number. */
static int announce(int connection, const char *node, int events) {
    struct request request = {.operation = OPERATION_OPEN};
    struct reply reply;
    if (!request_extra(&request, node, strlen(node)))
        return -ENAMETOOLONG;
    return bus_exchange(connection, &request, events, &reply);
}

static int open_node(const char *node, int flags) {
    int connection = bus_connect(), ends[2];
    if (connection < 0)
        return fail(ENOENT);
    int kind = SOCK_SEQPACKET | SOCK_CLOEXEC | (flags & O_NONBLOCK ? SOCK_NONBLOCK : 0);
    if (socketpair(AF_UNIX, kind, 0, ends) < 0) {
        int error = errno;
        REAL(close)(connection);
        return fail(error);
    }
    const int room = EVENT_BUFFER_BYTES;
    setsockopt(ends[1], SOL_SOCKET, SO_SNDBUF, &room, sizeof room); /* may be refused: the bus queues what does not fit */
    int result = ends[0] < MAX_DESCRIPTORS ? announce(connection, node, ends[1]) : -EMFILE;
    REAL(close)(ends[1]);
    if (result < 0) {
        REAL(close)(ends[0]);
        REAL(close)(connection);
        return fail(-result);
    }
    struct device *device = &devices[ends[0]];
    pthread_mutex_lock(&device->lock);
    device->connection = connection;
    device->ring = NULL;
    device->ring_bytes = 0;
    atomic_store(&device->is_open, true);
    pthread_mutex_unlock(&device->lock);
    return ends[0];
}

int svev_open(const char *path, int flags, mode_t mode) {
    const char *node = node_of_path(path);
    return node != NULL ? open_node(node, flags) : REAL(open)(path, flags, mode);
}

SHIM int close(int descriptor) {
    struct device *device = device_of(descriptor);
    if (device != NULL && lock_device(device)) {
        atomic_store(&device->is_open, false);
        REAL(close)(device->connection);
        pthread_mutex_unlock(&device->lock);
    }
    return REAL(close)(descriptor);
}

/* ---- events ---- */

SHIM ssize_t read(int descriptor, void *buffer, size_t bytes) {
    ssize_t received = REAL(read)(descriptor, buffer, bytes);
    if (received == 0 && bytes > 0 && device_of(descriptor) != NULL)
        return fail(ENODEV); /* the node was unplugged: the kernel returns this, a socket end of file */
    return received;
}

/* ---- the ring of received frames ---- */

/* Shares `bytes` of new memory with the bus. Returns its descriptor or a negative error number. */
static int share_memory(struct device *device, uint64_t bytes) {
    int memory = memfd_create("firewire ring", MFD_CLOEXEC);
    if (memory < 0)
        return -errno;
    struct request request = {.operation = OPERATION_MMAP};
    struct reply reply;
    int result = ftruncate(memory, (off_t)bytes) < 0 ? -errno : 0;
    if (result == 0 && request_argument(&request, &bytes, sizeof bytes))
        result = bus_exchange(device->connection, &request, memory, &reply);
    if (result < 0) {
        REAL(close)(memory);
        return result;
    }
    return memory;
}

static void *map_ring(struct device *device, void *address, size_t length, int protection, int flags) {
    const size_t page = (size_t)sysconf(_SC_PAGESIZE), bytes = (length + page - 1) / page * page;
    if (device->ring != NULL) { /* like the kernel, one buffer per file */
        errno = EBUSY;
        return MAP_FAILED;
    }
    int memory = share_memory(device, bytes);
    if (memory < 0) {
        errno = -memory;
        return MAP_FAILED;
    }
    void *ring = REAL(mmap)(address, bytes, protection, flags, memory, 0);
    REAL(close)(memory); /* the mapping keeps the memory */
    if (ring != MAP_FAILED) {
        device->ring = ring;
        device->ring_bytes = bytes;
    }
    return ring;
}

SHIM void *mmap(void *address, size_t length, int protection, int flags, int descriptor, off_t offset) {
    struct device *device = device_of(descriptor);
    if (device == NULL)
        return REAL(mmap)(address, length, protection, flags, descriptor, offset);
    if (!lock_device(device))
        return MAP_FAILED;
    void *ring = map_ring(device, address, length, protection, flags);
    pthread_mutex_unlock(&device->lock);
    return ring;
}

SHIM void *mmap64(void *address, size_t length, int protection, int flags, int descriptor, off64_t offset) {
    return mmap(address, length, protection, flags, descriptor, offset);
}

/* ---- ioctl ---- */

static const void *pointer(uint64_t address) {
    return (const void *)(uintptr_t)address;
}

/* Appends the data that the argument's pointers point to, and replaces an address in the ring by an offset. */
static bool pack(struct device *device, unsigned long code, const void *argument, struct request *request) {
    if (code == FW_CDEV_IOC_QUEUE_ISO) {
        struct fw_cdev_queue_iso queue = *(const struct fw_cdev_queue_iso *)argument;
        const void *packets = pointer(queue.packets);
        queue.data -= (uintptr_t)device->ring;
        return request_argument(request, &queue, sizeof queue) && request_extra(request, packets, queue.size);
    }
    if (!request_argument(request, argument, _IOC_SIZE(code)))
        return false;
    if (code == FW_CDEV_IOC_SEND_REQUEST || code == FW_CDEV_IOC_SEND_BROADCAST_REQUEST) {
        const struct fw_cdev_send_request *send = argument;
        if (send->tcode == WRITE_QUADLET || send->tcode == WRITE_BLOCK || send->tcode == LOCK_REQUEST)
            return request_extra(request, pointer(send->data), send->length);
    }
    return true;
}

/* Copies the reply to GET_INFO: the argument, then an event (the last bus reset) and the configuration ROM. */
static void unpack_info(struct fw_cdev_get_info *info, const struct reply *reply) {
    struct fw_cdev_get_info answer;
    struct fw_cdev_event_bus_reset reset;
    const uint8_t *extra = reply->payload + reply->argument_bytes;
    if (reply->argument_bytes < sizeof answer || reply->extra_bytes < sizeof reset)
        return;
    memcpy(&answer, reply->payload, sizeof answer);
    if (info->bus_reset != 0)
        memcpy((void *)(uintptr_t)info->bus_reset, extra, sizeof reset);
    uint32_t rom_bytes = reply->extra_bytes - (uint32_t)sizeof reset;
    if (info->rom != 0)
        memcpy((void *)(uintptr_t)info->rom, extra + sizeof reset, info->rom_length < rom_bytes ? info->rom_length : rom_bytes);
    info->version = answer.version;
    info->rom_length = rom_bytes;
    info->card = answer.card;
}

/* Advances `packets` and `data` past the queued part and leaves the size of the rest in `size`, as the kernel does. */
static void unpack_queue(struct device *device, struct fw_cdev_queue_iso *queue, const struct reply *reply) {
    struct fw_cdev_queue_iso answer;
    if (reply->argument_bytes < sizeof answer)
        return;
    memcpy(&answer, reply->payload, sizeof answer);
    queue->packets += queue->size - answer.size;
    queue->size = answer.size;
    queue->data = answer.data + (uintptr_t)device->ring;
}

static int ioctl_node(struct device *device, unsigned long code, void *argument) {
    struct request request;
    struct reply reply;
    request.operation = OPERATION_IOCTL;
    request.code = (uint32_t)code;
    request.argument_bytes = request.extra_bytes = 0;
    if (!pack(device, code, argument, &request))
        return -EINVAL;
    int result = bus_exchange(device->connection, &request, -1, &reply);
    if (result < 0)
        return result;
    if (code == FW_CDEV_IOC_GET_INFO)
        unpack_info(argument, &reply);
    else if (code == FW_CDEV_IOC_QUEUE_ISO)
        unpack_queue(device, argument, &reply);
    else if (_IOC_DIR(code) & _IOC_READ && reply.argument_bytes == _IOC_SIZE(code))
        memcpy(argument, reply.payload, reply.argument_bytes);
    return result;
}

SHIM int ioctl(int descriptor, unsigned long code, ...) {
    va_list arguments;
    va_start(arguments, code);
    void *argument = va_arg(arguments, void *);
    va_end(arguments);
    struct device *device = device_of(descriptor);
    if (device == NULL || _IOC_TYPE(code) != '#')
        return REAL(ioctl)(descriptor, code, argument);
    if (!lock_device(device))
        return -1;
    int result = ioctl_node(device, code, argument);
    pthread_mutex_unlock(&device->lock);
    return result < 0 ? fail(-result) : result;
}
