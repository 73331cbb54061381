/* SPDX-License-Identifier: Apache-2.0 */
#include <driveid/status.h>

const char *driveid_status_text(driveid_status status) {
    switch (status) {
    case DRIVEID_OK: return "ok";
    case DRIVEID_NOT_YET: return "not yet: too little data since start, restart or gap";
    case DRIVEID_WEAK_EXCITATION: return "weak excitation: the motion does not move every parameter, or has not confirmed it yet";
    case DRIVEID_RANK: return "parameters cannot be told apart with these data";
    case DRIVEID_FROZEN: return "the drive rests: parameters held";
    case DRIVEID_GAP: return "gap in the stamps: filters restarted";
    case DRIVEID_DUPLICATE: return "duplicate stamp: sample ignored";
    case DRIVEID_ERR_ARGUMENT: return "argument out of its documented range";
    case DRIVEID_ERR_CONFIG: return "configuration refused";
    case DRIVEID_ERR_TIME: return "stamp goes back in time: sample ignored";
    case DRIVEID_ERR_VALUE: return "sample is not a finite number: ignored";
    case DRIVEID_ERR_CAPACITY: return "more than the fixed sizes hold";
    case DRIVEID_ERR_NUMERIC: return "the solve failed";
    case DRIVEID_ERR_DATA: return "the record cannot answer";
    case DRIVEID_ERR_FORMAT: return "text does not parse";
    case DRIVEID_ERR_MEMORY: return "out of memory";
    }
    return "unknown status";
}
