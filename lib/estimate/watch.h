/* SPDX-License-Identifier: Apache-2.0 */
/* What every on-line method watches of its rows: does the last answer still explain them, and does the drive move. */
#ifndef DRIVEID_ESTIMATE_WATCH_H
#define DRIVEID_ESTIMATE_WATCH_H

#include "fsm_state.h"

/* Prediction error of a row phi (params of the equation), y with the last answer, into the monitor. 1: alarm. */
int watch_residual(driveid_svf_common *common, unsigned equation, const double *phi, double y, double dt_s);

/* Recent size of each motion column against its size in the sums (square: of each column's squares, weight rows): the drive rests where all are
 * small, and where one is small nothing new is learnt about its parameter, so nothing is forgotten. least and most: of what was seen so far. */
void watch_motion(driveid_svf_common *common, unsigned equation, const double *phi, const double *square, double weight, double dt_s,
                  double *least, double *most);

#endif
