#define _GNU_SOURCE
#include "open.h"

#include <fcntl.h>
#include <stdarg.h>

#include "real.h"

static int open_path(const char *path, int flags, va_list arguments) {
    return svev_open(path, flags, flags & (O_CREAT | O_TMPFILE) ? va_arg(arguments, mode_t) : 0);
}

SHIM int open(const char *path, int flags, ...) {
    va_list arguments;
    va_start(arguments, flags);
    int result = open_path(path, flags, arguments);
    va_end(arguments);
    return result;
}

SHIM int open64(const char *path, int flags, ...) {
    va_list arguments;
    va_start(arguments, flags);
    int result = open_path(path, flags | O_LARGEFILE, arguments);
    va_end(arguments);
    return result;
}
