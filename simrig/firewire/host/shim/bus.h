/* The connection to the bus process: one per open file, one reply per request.
 *
 * A message is one packet of a SOCK_SEQPACKET connection: a fixed head, the ioctl's argument, and what the argument's
 * pointers point to ("extra"). All numbers are in the machine's own byte order. The other end is simrig/firewire/host/wire.py.
 */
#ifndef SVEV_FIREWIRE_BUS_H
#define SVEV_FIREWIRE_BUS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Name of the bus's socket; "@name" is an abstract one. Without this variable the shim passes everything to libc. */
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
    int32_t result; /* like the kernel's: a negative one is an error number */
    uint32_t argument_bytes;
    uint32_t extra_bytes;
    uint8_t payload[MESSAGE_BYTES];
};

/* Whether the environment of this process names a bus. */
bool bus_configured(void);

/* Connects to the bus; -1 with errno if that fails. */
int bus_connect(void);

/* Appends to the payload of a request; false if there is no room for it. */
bool request_argument(struct request *request, const void *data, size_t bytes);
bool request_extra(struct request *request, const void *data, size_t bytes);

/* Sends a request, with a descriptor unless that is negative, waits for the reply and checks that it is complete.
 * Returns the reply's result, or -ENODEV if the bus is gone. */
int bus_exchange(int connection, const struct request *request, int descriptor, struct reply *reply);

#endif
