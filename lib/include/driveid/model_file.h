/* SPDX-License-Identifier: Apache-2.0 */
/* Model file: TOML, readable and hand-editable; the one reader and writer that daemon, Python and command line share.
 *
 *     format = 1
 *     structure = "rigid_axis"
 *
 *     [parameters.J_kgm2]
 *     value = 1.2e-4
 *     interval = [1.19e-4, 1.21e-4]
 *     unit = "kg m^2"
 *     state = "free"                 # "free" | "given" | "unset"
 *
 *     [[effect]]
 *     name = "coulomb"
 *     parameters.tau_c_Nm = { value = 0.01, interval = [0.009, 0.011], unit = "N m", state = "free" }
 *
 *     [[effect]]                     # an own effect
 *     name = "my_drag"
 *     formula = "c * omega_rad_s * cos(3*theta_rad)"
 *     adds_to = "tau_Nm"
 *
 *     [[history]]                    # one entry a step: what was done, errors before and after
 *     step = "add coulomb"
 *
 * Lives in the C++ library (driveid_batch): it allocates. */
#ifndef DRIVEID_MODEL_FILE_H
#define DRIVEID_MODEL_FILE_H

#include <stddef.h>

#include <driveid/model.h>

#ifdef __cplusplus
extern "C" {
#endif

/* text: zero-terminated TOML. On failure message holds line, key and mend. Unknown keys are errors. */
driveid_status driveid_model_read(const char *text, driveid_model *model, char *message, size_t message_size);

/* history: TOML text of the [[history]] entries to keep, or NULL. Returned text is freed with driveid_text_free(). */
driveid_status driveid_model_write(const driveid_model *model, const char *history, char **text);

/* The [[history]] entries of a model file as TOML text, for driveid_model_write(); "" where there are none. Freed with driveid_text_free(). */
driveid_status driveid_model_history(const char *text, char **history, char *message, size_t message_size);

void driveid_text_free(char *text);

#ifdef __cplusplus
}
#endif
#endif
