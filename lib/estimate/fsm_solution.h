/* SPDX-License-Identifier: Apache-2.0 */
/* Solving the sums of one stage: least squares over all equations, long-run covariance, validity. In f64. */
#ifndef DRIVEID_ESTIMATE_FSM_SOLUTION_H
#define DRIVEID_ESTIMATE_FSM_SOLUTION_H

#include "fsm_state.h"

#define FSM_SMALL 1e-11
#define FSM_PACKED (DRIVEID_THETA_MAX + 1)

/* Sums of one equation at one stage without initial conditions, (params + 1) square, the last row and column is y. */
typedef struct fsm_sums {
    double weight, weight2, rows, pole_rad_s;   /* pole_rad_s: of the stage's prefilter, 0: none */
    double spent;      /* initial conditions that were eliminated, each of which took a row's worth of residual */
    unsigned coarse;
    double s[FSM_PACKED * FSM_PACKED];
    const double *g;   /* [FSM_PAIRS(params + 1)][FSM_LAGS]: sums of x_i(t) x_j(t-lag) + x_j(t) x_i(t-lag), j <= i, of coarse rows */
} fsm_sums;

typedef struct fsm_solution {
    double theta[DRIVEID_THETA_MAX], cov[DRIVEID_THETA_MAX * DRIVEID_THETA_MAX];
    double share[DRIVEID_THETA_MAX];   /* rms of the parameter's column over rms of y or of its equation */
    double pivot[DRIVEID_THETA_MAX];   /* what no other column explains, of 1; 0: cannot be told apart */
    double residual_rms, rows, freedom, condition;
    int rank, instruments;             /* instruments: 0 where they failed and plain least squares was taken */
    int long_enough;                   /* there are rows enough for the lags over which the residual is correlated */
    int windows;                       /* rows are whole windows apart: as soon as there are enough of them nothing is left to confirm */
} fsm_solution;

/* solved[order x columns]: initial-condition columns as combinations of the others, by least squares. */
void fsm_solve_initial(const fsm_equation *equation, const double *s, double small, double *solved);
void fsm_eliminate_initial(const fsm_equation *equation, const double *solved, double *sums);
void fsm_pack(const fsm_equation *equation, const double *full, double *packed);
/* The same for lagged sums, whose columns are params, y, initial conditions; out may be g. */
void fsm_eliminate_lagged(const fsm_equation *equation, const double *solved, const double *g, double *out);

/* Coarse rows enough to judge a stage by. */
int fsm_enough(const driveid_svf_common *common, int equation, const fsm_sums *sums);

/* Size of the interval that this stage would give to its equation's parameters, logarithm; INFINITY where the stage cannot be judged:
 * too few rows, or a residual that stays correlated beyond the lags. theta: the current answer, NULL where there is none. */
double fsm_score(const driveid_svf_common *common, int equation, const fsm_sums *sums, double small, const double *theta);

/* sums[equations]: the chosen stage of each. 1 where there is a solution, 0 where there are too few rows. */
int fsm_solve(const driveid_svf_common *common, const fsm_sums *sums, double small, fsm_solution *out);

/* After a silence that the sums have all but forgotten, answers come from few rows again: they are to be confirmed anew. */
void fsm_silence(driveid_svf_common *common, double silence_s);

/* Verdict and answer (found = 0: none). */
void fsm_publish(driveid_svf_common *common, int found, const fsm_solution *best, int64_t t_ns);

#endif
