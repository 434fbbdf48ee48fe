/* libc's own functions, behind those of the same name that the shim interposes. */
#ifndef SVEV_REAL_H
#define SVEV_REAL_H

#include <stdatomic.h>

/* Finds `name` in the libraries after this one and stores it in `cached`. Any thread may call first, and so may constructors
 * of other libraries before ours has run: that is why nothing is looked up in advance. */
void *svev_real_function(_Atomic(void *) *cached, const char *name);

/* REAL(open)(path, flags): calls libc's own function. */
#define REAL(name)                                                         \
    ({                                                                     \
        static _Atomic(void *) cached_##name;                              \
        (__typeof__(&(name)))svev_real_function(&cached_##name, #name);    \
    })

/* Exports a function, so that it takes the place of libc's; all others are hidden (-fvisibility=hidden). */
#define SHIM __attribute__((visibility("default")))

#endif
