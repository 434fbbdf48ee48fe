/* Records what a program does to the files below one folder: preloaded into it, it notes each call that changes a file
 * or a folder, and each that makes a change durable, with the data, in the order in which they began and ended. The
 * system calls are made as they are, but for those that make durable: how long a busy disk takes for them is no matter of
 * the program, and nothing is cut but the recording.
 *
 * An entry is written when its call has ended, by one write to a file that only grows; entries of several threads and
 * processes are told apart by numbers from a counter that all of them share. */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/types.h>
#include <sys/uio.h>
#include <time.h>
#include <unistd.h>

/* The same layout as in recorded_disk.py. */
struct entry {
    uint64_t begin, end; /* numbers of the call's beginning and end */
    int64_t time_ns;     /* of its end, CLOCK_MONOTONIC */
    uint64_t inode, offset;
    uint32_t what, first, second, data; /* and bytes of two paths and of the data */
} __attribute__((packed));
enum { CREATE = 1, WRITE, CUT, SYNC, RENAME, NAME, REMOVE, FOLDER };

static _Atomic uint64_t *count;
static char root[PATH_MAX], notes[PATH_MAX];
static size_t root_length;

__attribute__((constructor)) static void begin(void)
{
    const char *counter = getenv("SVEV_TEST_COUNTER"), *folder = getenv("SVEV_TEST_ROOT"), *log = getenv("SVEV_TEST_NOTES");
    if (counter == NULL || folder == NULL || log == NULL)
        return;
    int fd = syscall(SYS_openat, AT_FDCWD, counter, O_RDWR | O_CLOEXEC, 0);
    if (fd < 0)
        return;
    void *memory = mmap(NULL, sizeof *count, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
    syscall(SYS_close, fd);
    snprintf(root, sizeof root, "%s", folder);
    snprintf(notes, sizeof notes, "%s", log);
    root_length = strlen(root);
    if (memory != MAP_FAILED)
        count = memory;
}

static uint64_t next(void)
{
    return atomic_fetch_add(count, 1);
}

static int is_below(const char *path)
{
    return count != NULL && strncmp(path, root, root_length) == 0 && (path[root_length] == '/' || path[root_length] == 0);
}

/* The absolute path of a name, as openat and its like understand it; 1 if it lies below the root. */
static int below(int folder, const char *name, char *path)
{
    if (count == NULL || name == NULL)
        return 0;
    int saved = errno;
    if (name[0] == '/') {
        snprintf(path, PATH_MAX, "%s", name);
    } else {
        char at[64];
        ssize_t length;
        snprintf(at, sizeof at, folder == AT_FDCWD ? "/proc/self/cwd" : "/proc/self/fd/%d", folder);
        length = syscall(SYS_readlinkat, AT_FDCWD, at, path, PATH_MAX - 1);
        if (length >= 0)
            snprintf(path + length, PATH_MAX - length, "/%s", name);
        else
            path[0] = 0;
    }
    errno = saved;
    return is_below(path);
}

/* Whether a descriptor is of a file or folder below the root, and which. */
static int is_ours(int fd, uint64_t *inode)
{
    char at[64], path[PATH_MAX];
    struct stat status;
    int saved = errno;
    if (count == NULL)
        return 0;
    snprintf(at, sizeof at, "/proc/self/fd/%d", fd);
    ssize_t length = syscall(SYS_readlinkat, AT_FDCWD, at, path, sizeof path - 1);
    path[length > 0 ? length : 0] = 0;
    int ours = is_below(path) && fstat(fd, &status) == 0 && (S_ISREG(status.st_mode) || S_ISDIR(status.st_mode));
    *inode = ours ? status.st_ino : 0;
    errno = saved;
    return ours;
}

static void note(uint64_t begin, uint32_t what, uint64_t inode, uint64_t offset, const char *first, const char *second,
                 const struct iovec *data, int pieces, size_t bytes)
{
    int saved = errno;
    struct timespec now;
    struct iovec out[3 + 1024];
    clock_gettime(CLOCK_MONOTONIC, &now);
    struct entry entry = {begin, next(), now.tv_sec * 1000000000LL + now.tv_nsec, inode, offset, what,
                          strlen(first), strlen(second), bytes};
    int used = 3;
    out[0] = (struct iovec){&entry, sizeof entry};
    out[1] = (struct iovec){(void *)first, entry.first};
    out[2] = (struct iovec){(void *)second, entry.second};
    for (int piece = 0; piece < pieces && bytes > 0 && used < 1024; piece++) {
        size_t length = data[piece].iov_len < bytes ? data[piece].iov_len : bytes;
        out[used++] = (struct iovec){data[piece].iov_base, length};
        bytes -= length;
    }
    int fd = syscall(SYS_openat, AT_FDCWD, notes, O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC, 0600);
    if (fd < 0 || bytes > 0 || syscall(SYS_writev, fd, out, used) < 0)
        abort(); /* what is recorded is all, or the test is worth nothing */
    syscall(SYS_close, fd);
    errno = saved;
}

static int opened(int folder, const char *name, int flags, mode_t mode)
{
    char path[PATH_MAX];
    struct stat status;
    int ours = (flags & O_ACCMODE) != O_RDONLY && below(folder, name, path);
    int temporary = (flags & O_TMPFILE) == O_TMPFILE;
    if (!ours)
        return syscall(SYS_openat, folder, name, flags, mode);
    int saved = errno;
    int there = !temporary && fstatat(AT_FDCWD, path, &status, 0) == 0;
    errno = saved;
    uint64_t began = next();
    int fd = syscall(SYS_openat, folder, name, flags, mode);
    if (fd >= 0 && fstat(fd, &status) == 0) {
        if (!there && (temporary || flags & O_CREAT))
            note(began, CREATE, status.st_ino, 0, temporary ? "" : path, "", NULL, 0, 0);
        else if (flags & O_TRUNC)
            note(began, CUT, status.st_ino, 0, "", "", NULL, 0, 0);
    }
    return fd;
}

#define MODE(flags) \
    mode_t mode = 0; \
    if (flags & (O_CREAT | O_TMPFILE)) { \
        va_list more; \
        va_start(more, flags); \
        mode = va_arg(more, mode_t); \
        va_end(more); \
    }
int open(const char *name, int flags, ...)
{
    MODE(flags)
    return opened(AT_FDCWD, name, flags, mode);
}
int open64(const char *name, int flags, ...)
{
    MODE(flags)
    return opened(AT_FDCWD, name, flags, mode);
}
int openat(int folder, const char *name, int flags, ...)
{
    MODE(flags)
    return opened(folder, name, flags, mode);
}
int openat64(int folder, const char *name, int flags, ...)
{
    MODE(flags)
    return opened(folder, name, flags, mode);
}
int creat(const char *name, mode_t mode)
{
    return opened(AT_FDCWD, name, O_CREAT | O_WRONLY | O_TRUNC, mode);
}

/* Writes at `offset`, or where the descriptor stands if it is negative. */
static ssize_t written(int fd, const struct iovec *data, int pieces, off_t offset)
{
    uint64_t inode;
    int ours = is_ours(fd, &inode);
    uint64_t began = ours ? next() : 0;
    ssize_t done = offset < 0 ? syscall(SYS_writev, fd, data, pieces) : syscall(SYS_pwritev, fd, data, pieces, offset, 0);
    if (ours && done > 0) {
        off_t at = offset < 0 ? syscall(SYS_lseek, fd, 0, SEEK_CUR) - done : offset;
        int flags = syscall(SYS_fcntl, fd, F_GETFL);
        note(began, WRITE, inode, at, "", "", data, pieces, done);
        if (flags & O_DSYNC)
            note(began, SYNC, inode, 0, "", "", NULL, 0, 0);
    }
    return done;
}
ssize_t write(int fd, const void *data, size_t length)
{
    return written(fd, &(struct iovec){(void *)data, length}, 1, -1);
}
ssize_t pwrite(int fd, const void *data, size_t length, off_t offset)
{
    return written(fd, &(struct iovec){(void *)data, length}, 1, offset);
}
ssize_t pwrite64(int fd, const void *data, size_t length, off64_t offset)
{
    return written(fd, &(struct iovec){(void *)data, length}, 1, offset);
}
ssize_t writev(int fd, const struct iovec *data, int pieces)
{
    return written(fd, data, pieces, -1);
}
ssize_t pwritev(int fd, const struct iovec *data, int pieces, off_t offset)
{
    return written(fd, data, pieces, offset);
}
ssize_t pwritev64(int fd, const struct iovec *data, int pieces, off64_t offset)
{
    return written(fd, data, pieces, offset);
}

/* Copies within the kernel: programs do without. */
ssize_t sendfile(int to, int from, off_t *offset, size_t length)
{
    uint64_t inode;
    if (!is_ours(to, &inode))
        return syscall(SYS_sendfile, to, from, offset, length);
    errno = EINVAL;
    return -1;
}
ssize_t sendfile64(int to, int from, off64_t *offset, size_t length)
{
    return sendfile(to, from, (off_t *)offset, length);
}
ssize_t copy_file_range(int from, off64_t *at, int to, off64_t *where, size_t length, unsigned flags)
{
    uint64_t inode;
    if (!is_ours(to, &inode))
        return syscall(SYS_copy_file_range, from, at, to, where, length, flags);
    errno = EXDEV;
    return -1;
}

static int cut(int fd, off_t length)
{
    uint64_t inode;
    int ours = is_ours(fd, &inode);
    uint64_t began = ours ? next() : 0;
    int result = syscall(SYS_ftruncate, fd, length);
    if (ours && result == 0)
        note(began, CUT, inode, length, "", "", NULL, 0, 0);
    return result;
}
int ftruncate(int fd, off_t length)
{
    return cut(fd, length);
}
int ftruncate64(int fd, off64_t length)
{
    return cut(fd, length);
}

static int synced(int fd, long call)
{
    uint64_t inode;
    if (!is_ours(fd, &inode))
        return syscall(call, fd);
    note(next(), SYNC, inode, 0, "", "", NULL, 0, 0);
    return 0;
}
int fsync(int fd)
{
    return synced(fd, SYS_fsync);
}
int fdatasync(int fd)
{
    return synced(fd, SYS_fdatasync);
}

/* A change of names. */
static int named(uint32_t what, int result, uint64_t began, int ours, const char *first, const char *second)
{
    struct stat status = {0};
    int saved = errno;
    if (ours && result == 0) {
        fstatat(AT_FDCWD, second[0] ? second : first, &status, AT_SYMLINK_NOFOLLOW);
        note(began, what, what == REMOVE ? 0 : status.st_ino, 0, first, second, NULL, 0, 0);
    }
    errno = saved;
    return result;
}

int renameat2(int from, const char *before, int to, const char *after, unsigned flags)
{
    char first[PATH_MAX] = "", second[PATH_MAX] = "";
    int ours = below(from, before, first) | below(to, after, second);
    uint64_t began = ours ? next() : 0;
    return named(RENAME, syscall(SYS_renameat2, from, before, to, after, flags), began, ours, first, second);
}
int renameat(int from, const char *before, int to, const char *after)
{
    return renameat2(from, before, to, after, 0);
}
int rename(const char *before, const char *after)
{
    return renameat2(AT_FDCWD, before, AT_FDCWD, after, 0);
}
int linkat(int from, const char *before, int to, const char *after, int flags)
{
    char path[PATH_MAX] = "";
    int ours = below(to, after, path);
    uint64_t began = ours ? next() : 0;
    return named(NAME, syscall(SYS_linkat, from, before, to, after, flags), began, ours, path, "");
}
int link(const char *before, const char *after)
{
    return linkat(AT_FDCWD, before, AT_FDCWD, after, 0);
}
int unlinkat(int folder, const char *name, int flags)
{
    char path[PATH_MAX] = "";
    int ours = below(folder, name, path);
    uint64_t began = ours ? next() : 0;
    return named(REMOVE, syscall(SYS_unlinkat, folder, name, flags), began, ours, path, "");
}
int unlink(const char *name)
{
    return unlinkat(AT_FDCWD, name, 0);
}
int rmdir(const char *name)
{
    return unlinkat(AT_FDCWD, name, AT_REMOVEDIR);
}
int remove(const char *name)
{
    int result = unlink(name);
    return result < 0 && errno == EISDIR ? rmdir(name) : result;
}
int mkdirat(int folder, const char *name, mode_t mode)
{
    char path[PATH_MAX] = "";
    int ours = below(folder, name, path);
    uint64_t began = ours ? next() : 0;
    return named(FOLDER, syscall(SYS_mkdirat, folder, name, mode), began, ours, path, "");
}
int mkdir(const char *name, mode_t mode)
{
    return mkdirat(AT_FDCWD, name, mode);
}
