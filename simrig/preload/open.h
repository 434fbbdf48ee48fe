/* open() and open64(), of which a shim only has to say what they do. */
#ifndef SVEV_OPEN_H
#define SVEV_OPEN_H

#include <sys/types.h>

/* Opens an emulated device, or any other file by REAL(open); each shim has its own. `mode` is 0 if none was given. */
int svev_open(const char *path, int flags, mode_t mode);

#endif
