/* The functions of libc behind those of the same name that the shim interposes. */
#ifndef SVEV_FIREWIRE_REAL_H
#define SVEV_FIREWIRE_REAL_H

#include <stdatomic.h>

/* Finds `name` in the libraries after this one and remembers it in `cached`. Any thread may be the first to ask; constructors
 * of other libraries may ask before ours ran, so nothing is prepared beforehand. */
void *svev_real_function(_Atomic(void *) *cached, const char *name);

/* REAL(open)(path, flags): calls libc's own function. */
#define REAL(name)                                                         \
    ({                                                                     \
        static _Atomic(void *) cached_##name;                              \
        (__typeof__(&(name)))svev_real_function(&cached_##name, #name);    \
    })

/* Marks what the shim puts in front of libc; everything else stays inside (-fvisibility=hidden). */
#define SHIM __attribute__((visibility("default")))

#endif
