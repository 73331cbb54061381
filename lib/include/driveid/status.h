/* SPDX-License-Identifier: Apache-2.0 */
/* Status: what a call says about its result.
 *
 *   0    a new, trustworthy result was written
 *   > 0  no new result, and nothing is wrong: wait, move the drive, or record something else
 *   < 0  the caller's or the environment's fault: mend it
 *
 * Results are written only when the status is DRIVEID_OK. No function writes NaN as a signal. */
#ifndef DRIVEID_STATUS_H
#define DRIVEID_STATUS_H

#ifdef __cplusplus
extern "C" {
#endif

typedef enum driveid_status {
    DRIVEID_OK = 0,

    DRIVEID_NOT_YET = 1,         /* too little data since start, restart or gap */
    DRIVEID_WEAK_EXCITATION = 2, /* the data do not move every parameter, or do not confirm it yet; see driveid_estimate.weak_mask */
    DRIVEID_RANK = 3,            /* parameters cannot be told apart with these data; see driveid_estimate.weak_mask */
    DRIVEID_FROZEN = 4,          /* the drive rests: parameters held, nothing learnt */
    DRIVEID_GAP = 5,             /* a gap in the stamps was handled: filters restarted */
    DRIVEID_DUPLICATE = 6,       /* the sample repeats the last stamp and was ignored */

    DRIVEID_ERR_ARGUMENT = -1,   /* null pointer, unknown name, value out of the documented range */
    DRIVEID_ERR_CONFIG = -2,     /* the configuration contradicts itself or asks for what conditioning rules out */
    DRIVEID_ERR_TIME = -3,       /* stamp earlier than the last one: the sample was ignored */
    DRIVEID_ERR_VALUE = -4,      /* NaN or infinity in a sample: the sample was ignored */
    DRIVEID_ERR_CAPACITY = -5,   /* more channels, terms or rows than the fixed sizes allow */
    DRIVEID_ERR_NUMERIC = -6,    /* a solve failed on finite data */
    DRIVEID_ERR_DATA = -7,       /* a record cannot answer: too short, a needed column missing, no excitation */
    DRIVEID_ERR_FORMAT = -8,     /* a file or text does not parse; the message names line, key and mend */
    DRIVEID_ERR_MEMORY = -9      /* batch and diagnose only: the core never allocates */
} driveid_status;

/* Short English sentence for a status, never NULL. */
const char *driveid_status_text(driveid_status status);

#ifdef __cplusplus
}
#endif
#endif
