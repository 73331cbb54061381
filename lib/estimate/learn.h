/* SPDX-License-Identifier: Apache-2.0 */
/* What every row-by-row method shares: stamps, gaps, rest, alarm and restart; sums of rows; least squares with rank; honest intervals.
 *
 *   samples -> method's filters -> row  y = phi theta  of each equation and stage -> sums -> theta, interval -> answer
 *
 * A method is a table of functions (learn_method) and a state whose first member is a learner. A stage is one setting of the method's filters
 * (a window length); the answer comes from the stage whose interval is smallest.
 * Noise of the differentiated channel would draw least squares towards zero. Two remedies: instruments (the known side y stands for the highest
 * derivative's column, as in fsm), or, where the equation has one channel only, the noise's moments are taken off (total least squares).
 * Interval: the score phi (y - phi theta) is summed over blocks longer than the filters remember; their scatter, with that of neighbours, is
 * the score's long-run covariance B, and cov = H B H with H the inverse of sum phi phi'. Without a remedy the
 * whole residual may be noise of the differentiated channel: the bound of that bias is added in squares. */
#ifndef DRIVEID_ESTIMATE_LEARN_H
#define DRIVEID_ESTIMATE_LEARN_H

#include "fsm_solution.h"
#include "fsm_state.h"

#define LEARN_STAGES 4
#define LEARN_WIDE (DRIVEID_THETA_MAX + 1)
#define LEARN_BLOCKS 8.0    /* before anything is said */
#define LEARN_BLOCKS_MOST 48.0 /* behind the interval */

typedef struct learn_sums { /* of one equation at one stage; phi in the equation's order, y last */
    double s[LEARN_WIDE * LEARN_WIDE];
    double outer[DRIVEID_THETA_MAX * DRIVEID_THETA_MAX]; /* of block scores, with half of what neighbours share */
    double open[DRIVEID_THETA_MAX], before[DRIVEID_THETA_MAX];
    double open_s;
    double weight, weight2;  /* sum of weights of rows, of their squares */
    double rows_scored, blocks;
    uint32_t open_rows;
} learn_sums;

typedef struct learner {
    driveid_svf_common common;
    uint8_t known[LEARN_STAGES]; /* theta is a first guess at least: scores can be taken */
    uint8_t correlated;      /* residuals hang together from start to end: rows count as one */
    uint8_t instruments;     /* the known side stands for the highest derivative's column, whose noise is then harmless */
    uint8_t homogeneous;     /* one equation of one measured channel: every column carries its noise, see moment */
    double moment[LEARN_STAGES][LEARN_WIDE * LEARN_WIDE]; /* of the columns' noise in one row, per variance of white noise of that channel */
    double shift[LEARN_STAGES][DRIVEID_THETA_MAX];        /* what that noise makes of a row's score */
    double theta[LEARN_STAGES][DRIVEID_THETA_MAX];
    double block_s[LEARN_STAGES];
    int64_t row_ns[LEARN_STAGES], last_row_ns[LEARN_STAGES];
    learn_sums sums[LEARN_STAGES][DRIVEID_EQUATIONS_MAX];
} learner;

typedef struct learn_method {
    size_t bytes;
    /* After the common part is resolved; level[] as for the bank. May refuse with a reason. */
    driveid_status (*configure)(learner *self, const uint8_t *level, char *reason, size_t reason_size);
    void (*start)(learner *self, const double *channel);                 /* filters begin with this sample */
    void (*step)(learner *self, int64_t dt_ns, const double *channel);   /* and go on with this one */
    int (*row)(learner *self, unsigned equation, unsigned stage, double *x); /* phi, then y; 0: none yet */
    /* NULL where the sums are all there is: a row into the method's own recursion; its theta and H; forget all. */
    void (*learn)(learner *self, unsigned equation, const double *x, double decay, double dt_s);
    void (*solution)(learner *self, double *theta, double *h, double *variance);
    void (*clear)(learner *self);
} learn_method;

driveid_status learn_configure(learner *self, const learn_method *method, const driveid_regression *regression,
                               const driveid_estimator_options *options, char *reason, size_t reason_size);
driveid_status learn_update(learner *self, const learn_method *method, int64_t t_ns, const double *channel);
void learn_restart(learner *self, const learn_method *method);

/* learn_sums.c */
void learn_sums_row(learner *self, unsigned equation, unsigned stage, const double *x, double dt_s, double decay);
void learn_sums_forget(learner *self, double factor);
void learn_sums_skip(learner *self); /* the open blocks end where the stream breaks */
void learn_sums_clear(learner *self);
/* The best answer; 0: too little yet. */
int learn_solve(learner *self, const learn_method *method, fsm_solution *out);

#endif
