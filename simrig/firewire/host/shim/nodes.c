/* Shows the emulated nodes in /dev to opendir, readdir, stat and access, and hides real FireWire nodes. */
#define _GNU_SOURCE
#include "nodes.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <unistd.h>

#include "bus.h"
#include "real.h"

_Static_assert(sizeof(struct stat) == sizeof(struct stat64) && sizeof(struct dirent) == sizeof(struct dirent64),
               "64-bit systems only: the functions with and without 64 in their names must be the same");

#define DEVICE_MAJOR 240 /* "for local use" */

bool is_node_name(const char *name) {
    if (strncmp(name, "fw", 2) != 0 || name[2] == '\0')
        return false;
    return strspn(name + 2, "0123456789") == strlen(name + 2) && strlen(name) < NODE_NAME_BYTES;
}

const char *node_of_path(const char *path) {
    static const char directory[] = "/dev/";
    const size_t length = sizeof directory - 1;
    if (path == NULL || strncmp(path, directory, length) != 0 || !is_node_name(path + length) || !bus_configured())
        return NULL;
    return path + length;
}

void list_nodes(struct node_list *list) {
    memset(list, 0, sizeof *list);
    int error = errno;
    int connection = bus_connect();
    if (connection < 0) {
        errno = error;
        return;
    }
    struct request request = {.operation = OPERATION_LIST};
    struct reply reply;
    int result = bus_exchange(connection, &request, -1, &reply);
    REAL(close)(connection);
    errno = error;
    if (result < 0)
        return;
    list->permissions = (unsigned)result;
    const char *name = (const char *)reply.payload + reply.argument_bytes, *end = name + reply.extra_bytes;
    while (name < end && list->count < MAX_NODES) {
        size_t length = strnlen(name, (size_t)(end - name));
        snprintf(list->names[list->count++], NODE_NAME_BYTES, "%.*s", (int)length, name);
        name += length + 1;
    }
}

/* ---- open directories of /dev ---- */

struct listing {
    DIR *directory;
    int next;
    struct node_list nodes;
    struct dirent entry;
    struct listing *following;
};

static pthread_mutex_t listings_lock = PTHREAD_MUTEX_INITIALIZER;
static struct listing *listings;
static atomic_int listings_open; /* while 0, no call takes the lock */

static struct listing *find_listing(DIR *directory) {
    struct listing *found = listings;
    while (found != NULL && found->directory != directory)
        found = found->following;
    return found;
}

SHIM DIR *opendir(const char *path) {
    DIR *directory = REAL(opendir)(path);
    if (directory == NULL || (strcmp(path, "/dev") != 0 && strcmp(path, "/dev/") != 0) || !bus_configured())
        return directory;
    struct listing *listing = calloc(1, sizeof *listing);
    if (listing == NULL)
        return directory;
    list_nodes(&listing->nodes);
    listing->directory = directory;
    pthread_mutex_lock(&listings_lock);
    listing->following = listings;
    listings = listing;
    atomic_fetch_add(&listings_open, 1);
    pthread_mutex_unlock(&listings_lock);
    return directory;
}

/* The next emulated entry, NULL after the last; sets `ours` if the directory is /dev. */
static struct dirent *next_node(DIR *directory, bool *ours) {
    struct dirent *entry = NULL;
    pthread_mutex_lock(&listings_lock);
    struct listing *listing = find_listing(directory);
    *ours = listing != NULL;
    if (listing != NULL && listing->next < listing->nodes.count) {
        entry = &listing->entry;
        memset(entry, 0, sizeof *entry);
        entry->d_ino = (ino_t)(listing->next + 1);
        entry->d_type = DT_CHR;
        entry->d_reclen = sizeof *entry;
        strcpy(entry->d_name, listing->nodes.names[listing->next++]);
    }
    pthread_mutex_unlock(&listings_lock);
    return entry;
}

SHIM struct dirent *readdir(DIR *directory) {
    bool ours = false;
    if (atomic_load(&listings_open) > 0) {
        struct dirent *entry = next_node(directory, &ours);
        if (entry != NULL)
            return entry;
    }
    struct dirent *entry;
    do
        entry = REAL(readdir)(directory);
    while (ours && entry != NULL && is_node_name(entry->d_name)); /* hides the machine's own FireWire nodes */
    return entry;
}

SHIM struct dirent64 *readdir64(DIR *directory) {
    return (struct dirent64 *)readdir(directory);
}

SHIM int closedir(DIR *directory) {
    if (atomic_load(&listings_open) > 0) {
        pthread_mutex_lock(&listings_lock);
        struct listing **link = &listings;
        while (*link != NULL && (*link)->directory != directory)
            link = &(*link)->following;
        struct listing *listing = *link;
        if (listing != NULL) {
            *link = listing->following;
            atomic_fetch_sub(&listings_open, 1);
        }
        pthread_mutex_unlock(&listings_lock);
        free(listing);
    }
    return REAL(closedir)(directory);
}

/* ---- single files ---- */

/* Sets `permissions` of an emulated node; false, with errno, if the bus has no such node. */
static bool find_node(const char *name, unsigned *permissions) {
    struct node_list list;
    list_nodes(&list);
    *permissions = list.permissions;
    for (int index = 0; index < list.count; index++)
        if (strcmp(list.names[index], name) == 0)
            return true;
    errno = ENOENT;
    return false;
}

static int stat_node(const char *name, struct stat *status) {
    unsigned permissions;
    if (!find_node(name, &permissions))
        return -1;
    memset(status, 0, sizeof *status);
    status->st_mode = S_IFCHR | permissions;
    status->st_nlink = 1;
    status->st_uid = getuid();
    status->st_gid = getgid();
    status->st_rdev = makedev(DEVICE_MAJOR, (unsigned)atoi(name + 2));
    return 0;
}

static int access_node(const char *name, int mode) {
    unsigned permissions;
    if (!find_node(name, &permissions))
        return -1;
    if ((mode & R_OK && !(permissions & S_IRUSR)) || (mode & W_OK && !(permissions & S_IWUSR)) || mode & X_OK) {
        errno = EACCES;
        return -1;
    }
    return 0;
}

SHIM int stat(const char *path, struct stat *status) {
    const char *node = node_of_path(path);
    return node != NULL ? stat_node(node, status) : REAL(stat)(path, status);
}

SHIM int stat64(const char *path, struct stat64 *status) {
    return stat(path, (struct stat *)status);
}

SHIM int lstat(const char *path, struct stat *status) {
    const char *node = node_of_path(path);
    return node != NULL ? stat_node(node, status) : REAL(lstat)(path, status);
}

SHIM int lstat64(const char *path, struct stat64 *status) {
    return lstat(path, (struct stat *)status);
}

SHIM int fstatat(int directory, const char *path, struct stat *status, int flags) {
    const char *node = node_of_path(path);
    return node != NULL ? stat_node(node, status) : REAL(fstatat)(directory, path, status, flags);
}

SHIM int fstatat64(int directory, const char *path, struct stat64 *status, int flags) {
    return fstatat(directory, path, (struct stat *)status, flags);
}

SHIM int access(const char *path, int mode) {
    const char *node = node_of_path(path);
    return node != NULL ? access_node(node, mode) : REAL(access)(path, mode);
}

SHIM int faccessat(int directory, const char *path, int mode, int flags) {
    const char *node = node_of_path(path);
    return node != NULL ? access_node(node, mode) : REAL(faccessat)(directory, path, mode, flags);
}
