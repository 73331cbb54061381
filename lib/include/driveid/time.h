/* SPDX-License-Identifier: Apache-2.0 */
/* Time: int64 monotonic nanoseconds of the sampling instant. Wall clock is never used for a difference. */
#ifndef DRIVEID_TIME_H
#define DRIVEID_TIME_H

#include <stdint.h>

typedef enum driveid_clock {
    DRIVEID_CLOCK_UNKNOWN = 0,
    DRIVEID_CLOCK_HARDWARE = 1, /* stamped by the bus controller */
    DRIVEID_CLOCK_KERNEL = 2,   /* stamped by the kernel at reception */
    DRIVEID_CLOCK_DAEMON = 3,   /* read by the daemon around the transaction; err_ns is half the transaction */
    DRIVEID_CLOCK_DEVICE = 4,   /* counter carried in the payload, unwrapped */
    DRIVEID_CLOCK_RECORD = 5    /* taken from a recording */
} driveid_clock;

typedef struct driveid_stamp {
    int64_t t_ns;     /* sampling instant, monotonic */
    int64_t err_ns;   /* |error| bound of t_ns, >= 0 */
    driveid_clock clock;
} driveid_stamp;

#define DRIVEID_NS_PER_S INT64_C(1000000000)

#endif
