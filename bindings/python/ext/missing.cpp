// SPDX-License-Identifier: Apache-2.0
// Weak stand-ins: where a library was built without one of these functions, the call says so instead of the import failing.
#include <cstdio>

#include <driveid/diagnose.h>
#include <driveid/model.h>

#define WEAK extern "C" __attribute__((weak))

static driveid_status not_built(const char *what, char *message, size_t size) {
    if (message && size) std::snprintf(message, size, "%s is not built into this library: rebuild driveid with DRIVEID_BATCH=ON", what);
    return DRIVEID_ERR_CONFIG;
}

#define TASK(name) WEAK driveid_status name(const driveid_task *, char **, char *m, size_t n) { return not_built(#name, m, n); }
TASK(driveid_fit)
TASK(driveid_compare)
TASK(driveid_explain)
TASK(driveid_improve)
TASK(driveid_power)

WEAK driveid_status driveid_add(const char *, const char *, char **, char *m, size_t n) { return not_built("driveid_add", m, n); }
WEAK driveid_status driveid_new(const char *, const char *const *, size_t, char **, char *m, size_t n) { return not_built("driveid_new", m, n); }
WEAK driveid_status driveid_catalogue(char **) { return DRIVEID_ERR_CONFIG; }
WEAK driveid_status driveid_series(const char *, const driveid_record *, char **, double **, char *m, size_t n) { return not_built("driveid_series", m, n); }
WEAK void driveid_series_free(double *) {}
WEAK driveid_status driveid_model_read(const char *, driveid_model *, char *m, size_t n) { return not_built("driveid_model_read", m, n); }
WEAK void driveid_text_free(char *) {}
WEAK const char *driveid_structure_name(driveid_structure) { return nullptr; }
WEAK driveid_status driveid_online_init(driveid_online *, const driveid_model *, uint32_t, char *m, size_t n) { return not_built("driveid_online_init", m, n); }
WEAK driveid_status driveid_online_channels(driveid_online *, const driveid_sample *, double *) { return DRIVEID_ERR_CONFIG; }
WEAK driveid_status driveid_online_physical(const driveid_online *, const driveid_estimate *, driveid_param *, uint32_t *) { return DRIVEID_ERR_CONFIG; }
WEAK size_t driveid_estimator_size(const char *, driveid_real) { return 0; }
WEAK driveid_status driveid_estimator_configure(driveid_estimator *, size_t, const char *, driveid_real, const driveid_regression *, const driveid_estimator_options *, char *m, size_t n) { return not_built("driveid_estimator", m, n); }
WEAK driveid_status driveid_estimator_update(driveid_estimator *, int64_t, const double *) { return DRIVEID_ERR_CONFIG; }
WEAK driveid_status driveid_estimator_estimate(const driveid_estimator *, driveid_estimate *) { return DRIVEID_ERR_CONFIG; }
WEAK void driveid_estimator_restart(driveid_estimator *) {}
