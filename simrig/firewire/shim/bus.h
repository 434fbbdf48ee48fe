/* The wire to the bus process: one connection per open file, one reply per request.
 *
 * A message is one packet of a SOCK_SEQPACKET connection: a fixed head, the ioctl's argument, and what the argument's
 * pointers point to ("extra"). All numbers are in the machine's own byte order. The other end is simrig/firewire/wire.py.
 */
#ifndef SVEV_FIREWIRE_BUS_H
#define SVEV_FIREWIRE_BUS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Name of the bus's socket; "@name" is an abstract one. Without it the shim does nothing at all. */
#define BUS_VARIABLE "SVEV_FIREWIRE_BUS"

#define MESSAGE_BYTES 16384

enum operation {
    OPERATION_LIST = 1,  /* extra of the reply: names of the nodes, each ended by a NUL; result: their permission bits */
    OPERATION_OPEN = 2,  /* extra: name of the node; a descriptor travels along: our end for events */
    OPERATION_IOCTL = 3, /* code: the request */
    OPERATION_MMAP = 4,  /* argument: length (u64); a descriptor travels along: the memory */
};

struct request {
    uint32_t operation;
    uint32_t code;
    uint32_t argument_bytes;
    uint32_t extra_bytes;
    uint8_t payload[MESSAGE_BYTES];
};

struct reply {
    int32_t result; /* as the kernel's: negative means an error number */
    uint32_t argument_bytes;
    uint32_t extra_bytes;
    uint8_t payload[MESSAGE_BYTES];
};

/* Whether this process was told of a bus. */
bool bus_configured(void);

/* Connects to the bus; -1 with errno if it is not there. */
int bus_connect(void);

/* Appends to the payload of a request; false if there is no room for it. */
bool request_argument(struct request *request, const void *data, size_t bytes);
bool request_extra(struct request *request, const void *data, size_t bytes);

/* Sends a request, with a descriptor unless that is negative, and waits for the reply, which is checked for completeness.
 * Returns the reply's result, or the negative error number of the connection: -ENODEV once the bus is gone. */
int bus_exchange(int connection, const struct request *request, int descriptor, struct reply *reply);

#endif
