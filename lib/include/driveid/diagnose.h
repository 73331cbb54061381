/* SPDX-License-Identifier: Apache-2.0 */
/* Diagnose: fit a model to records, compare, see where it fails, learn which effect is missing, add it.
 *
 * Each function takes a model as TOML text (model_file.h) and records as columns, and writes one JSON document, the
 * one that docs/manual/json.md describes. The document is written with every status but DRIVEID_ERR_ARGUMENT,
 * _FORMAT and _MEMORY; where the data are at fault its verdict is "bad_data" and the status DRIVEID_ERR_DATA.
 * Texts are freed with driveid_text_free(). Thread-safe: no global state. */
#ifndef DRIVEID_DIAGNOSE_H
#define DRIVEID_DIAGNOSE_H

#include <stddef.h>
#include <stdint.h>

#include <driveid/model_file.h>
#include <driveid/status.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct driveid_column {
    const char *name;     /* symbol and unit: "theta_rad" */
    const double *value;  /* rows, SI; NaN marks a missing value */
} driveid_column;

typedef struct driveid_record {
    const char *name;     /* shown in answers */
    const char *hash;     /* SHA-256 of the file, hex; may be NULL */
    const char *hold;     /* "average" | "zoh" | "instant" | NULL: detected and said */
    size_t rows, columns;
    const int64_t *t_ns;  /* rows */
    const driveid_column *column;
} driveid_record;

/* Called from the working thread, done in 0..1; a non-zero return cancels (DRIVEID_NOT_YET is returned, no document). */
typedef int (*driveid_progress)(void *context, double done, const char *what);

typedef struct driveid_task {
    const char *model_toml;
    const driveid_record *training;  size_t trainings;
    const driveid_record *held_out;  size_t held_outs;   /* 0: contiguous blocks of training are set aside, and it is said which */
    const char *options_json;        /* NULL, or {"seed": 1, "threads": 2, "effects": ["coulomb", ...], ...} */
    driveid_progress progress; void *progress_context;
} driveid_task;

/* message: one sentence for people where the status is < 0. The JSON of fit, add and improve carries the new model as "model_toml". */
driveid_status driveid_fit(const driveid_task *task, char **json, char *message, size_t message_size);
driveid_status driveid_compare(const driveid_task *task, char **json, char *message, size_t message_size);
driveid_status driveid_explain(const driveid_task *task, char **json, char *message, size_t message_size);
driveid_status driveid_improve(const driveid_task *task, char **json, char *message, size_t message_size);
driveid_status driveid_power(const driveid_task *task, char **json, char *message, size_t message_size);

/* Model with one effect more (parameters unset), as TOML. */
driveid_status driveid_add(const char *model_toml, const char *effect, char **new_toml, char *message, size_t message_size);

/* New model: given = "K_t_Nm_A=0.05" strings. */
driveid_status driveid_new(const char *structure, const char *const *given, size_t givens, char **toml, char *message, size_t message_size);

/* The effect catalogue as JSON: name, equation, parameters with units and bounds, signature, confused with, separating motion, literature. */
driveid_status driveid_catalogue(char **json);

/* Series for plots: the signals, the model's prediction and the residual of each equation and simulation on one record.
 * JSON header in *json ({"series": [{"name", "unit", "what"}], "rows"}), values in *data (series-major, rows each), freed with driveid_series_free(). */
driveid_status driveid_series(const char *model_toml, const driveid_record *record, char **json, double **data, char *message, size_t message_size);
void driveid_series_free(double *data);

#ifdef __cplusplus
}
#endif
#endif
