/* The nodes of the emulated bus, as /dev shows them. */
#ifndef SVEV_FIREWIRE_NODES_H
#define SVEV_FIREWIRE_NODES_H

#include <stdbool.h>

#define NODE_NAME_BYTES 16
#define MAX_NODES 64

struct node_list {
    int count;
    unsigned permissions; /* of all nodes, e.g. 0660 */
    char names[MAX_NODES][NODE_NAME_BYTES];
};

/* Whether `name` is fw0, fw1, ... */
bool is_node_name(const char *name);

/* The name in a path /dev/fw0, /dev/fw1, ...; NULL for any other path, and always if the environment names no bus. */
const char *node_of_path(const char *path);

/* Asks the bus for its nodes; the list is empty if the bus does not answer. */
void list_nodes(struct node_list *list);

#endif
