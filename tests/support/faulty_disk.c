/* Faults of the disk for the tests: preloaded into the program under test, it stands between the program and the calls
 * that write to log files (*.mcap). What happens to a call stands in a file that both sides map, so that the test
 * changes it while the program runs. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/types.h>
#include <time.h>
#include <unistd.h>

/* The same layout as in faulty_disk.py. */
struct faults {
    _Atomic uint32_t calls;     /* which calls: bits of CALL_... */
    _Atomic int32_t error;      /* error number that they give, 0: none */
    _Atomic uint64_t least;     /* only writes of at least so many bytes */
    _Atomic uint64_t most;      /* only writes of at most so many bytes */
    _Atomic uint64_t hang;      /* 1: they do not return while this is set */
    _Atomic uint64_t rate;      /* bytes per second that the disk takes, 0: as fast as it can */
    _Atomic uint64_t skip;      /* so many calls pass before the error */
    _Atomic uint64_t hit;       /* calls that a fault has hit */
    char only[256];             /* only files whose path begins like this */
};
enum { CALL_WRITE = 1, CALL_SYNC = 2, CALL_CUT = 4, CALL_OPEN = 8 };

static struct faults *faults;
static ssize_t (*real_pwrite)(int, const void *, size_t, off64_t);
static int (*real_fsync)(int), (*real_fdatasync)(int), (*real_ftruncate)(int, off64_t), (*real_open)(const char *, int, ...);
static pthread_mutex_t disk = PTHREAD_MUTEX_INITIALIZER;

__attribute__((constructor)) static void begin(void)
{
    real_pwrite = dlsym(RTLD_NEXT, "pwrite64");
    real_fsync = dlsym(RTLD_NEXT, "fsync");
    real_fdatasync = dlsym(RTLD_NEXT, "fdatasync");
    real_ftruncate = dlsym(RTLD_NEXT, "ftruncate64");
    real_open = dlsym(RTLD_NEXT, "open64");
    const char *path = getenv("SVEV_TEST_DISK");
    int fd = path == NULL ? -1 : real_open(path, O_RDWR | O_CLOEXEC);
    if (fd < 0)
        return;
    void *memory = mmap(NULL, sizeof(struct faults), PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
    close(fd);
    if (memory != MAP_FAILED)
        faults = memory;
}

static int is_log(const char *path)
{
    return strstr(path, ".mcap") != NULL && strncmp(path, faults->only, strlen(faults->only)) == 0;
}

static int of_log(int fd)
{
    char link[64], path[4096];
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    ssize_t length = readlink(link, path, sizeof path - 1);
    if (length < 0)
        return 0;
    path[length] = 0;
    return is_log(path);
}

static void rest(double seconds)
{
    struct timespec time = {(time_t)seconds, (long)((seconds - (double)(time_t)seconds) * 1e9)};
    nanosleep(&time, NULL);
}

/* Whether the call fails; errno is set then. */
static int fails(uint32_t call, size_t size)
{
    if (!(faults->calls & call) || (call == CALL_WRITE && (size < faults->least || size > faults->most)))
        return 0;
    if (faults->hang) {
        faults->hit++;
        while (faults->hang)
            rest(0.01);
    }
    if (faults->error == 0)
        return 0;
    if (faults->skip > 0) {
        faults->skip--;
        return 0;
    }
    faults->hit++;
    errno = faults->error;
    return 1;
}

ssize_t pwrite64(int fd, const void *data, size_t size, off64_t offset)
{
    if (faults == NULL || !of_log(fd))
        return real_pwrite(fd, data, size, offset);
    if (fails(CALL_WRITE, size))
        return -1;
    uint64_t rate = faults->rate;
    if (rate > 0) { /* one disk for all threads */
        pthread_mutex_lock(&disk);
        rest((double)size / (double)rate);
        pthread_mutex_unlock(&disk);
    }
    return real_pwrite(fd, data, size, offset);
}
ssize_t pwrite(int fd, const void *data, size_t size, off_t offset) { return pwrite64(fd, data, size, offset); }

int fsync(int fd)
{
    return faults != NULL && of_log(fd) && fails(CALL_SYNC, 0) ? -1 : real_fsync(fd);
}

int fdatasync(int fd)
{
    return faults != NULL && of_log(fd) && fails(CALL_SYNC, 0) ? -1 : real_fdatasync(fd);
}

int ftruncate64(int fd, off64_t size)
{
    return faults != NULL && of_log(fd) && fails(CALL_CUT, 0) ? -1 : real_ftruncate(fd, size);
}
int ftruncate(int fd, off_t size) { return ftruncate64(fd, size); }

int open64(const char *path, int flags, ...)
{
    va_list more;
    va_start(more, flags);
    mode_t mode = va_arg(more, mode_t);
    va_end(more);
    if (faults != NULL && (flags & O_CREAT) && is_log(path) && fails(CALL_OPEN, 0))
        return -1;
    return real_open(path, flags, mode);
}
int open(const char *path, int flags, ...)
{
    va_list more;
    va_start(more, flags);
    mode_t mode = va_arg(more, mode_t);
    va_end(more);
    return open64(path, flags, mode);
}
