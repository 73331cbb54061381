/* SPDX-License-Identifier: Apache-2.0 */
#include <driveid/monitor.h>

#include <string.h>

#define BLOCKS_FIRST 20     /* 1 s before the first alarm */
#define BLOCKS_MEMORY 200.0 /* 10 s of blocks make what is usual */
#define LEVEL_FALL 1e-5     /* of the level a block: a day of rest */

void driveid_monitor_init(driveid_monitor *self, double threshold) {
    memset(self, 0, sizeof *self);
    self->threshold = threshold == 0 ? 4 : threshold;
}

void driveid_monitor_skip(driveid_monitor *self) {
    self->e2 = self->y2 = self->p2 = self->open_s = 0;
    self->rows = 0;
    self->over = 0;
}

/* level falls so slowly that a rest does not turn noise into work. */
static void learn(driveid_monitor *self, double e2, double y2) {
    if (self->blocks == 0) self->noise = e2;
    if (self->blocks < UINT32_MAX) self->blocks++;
    const double share = 1 / (self->blocks < BLOCKS_MEMORY ? (double)self->blocks : BLOCKS_MEMORY);
    self->level += (y2 > self->level ? share > 0.05 ? share : 0.05 : LEVEL_FALL) * (y2 - self->level);
    const int works = y2 > 0.1 * self->level && y2 > 0;
    if (!works || e2 < self->noise) self->noise += share * (e2 - self->noise);
    if (works) self->ratio += share * ((e2 > self->noise ? e2 - self->noise : 0) / y2 - self->ratio);
}

static int close_block(driveid_monitor *self) {
    const double e2 = self->e2 / self->rows, y2 = self->y2 / self->rows, p2 = self->p2 / self->rows;
    const double usual = self->noise + (self->ratio + DRIVEID_MONITOR_TOLERANCE * DRIVEID_MONITOR_TOLERANCE) * y2;
    self->last_e2 = e2;
    self->last_limit = self->threshold * self->threshold * usual + 9 * p2;
    const int ready = self->blocks >= BLOCKS_FIRST && self->threshold > 0;
    const uint32_t over = ready && e2 > self->last_limit ? self->over + 1 : 0;
    driveid_monitor_skip(self);
    if (!over) learn(self, e2, y2);
    self->over = over;
    if (over < 2) return 0;
    self->over = 0;
    return 1;
}

int driveid_monitor_feed(driveid_monitor *self, double residual, double drive_squared, double parameter_squared, double dt_s) {
    self->e2 += residual * residual;
    self->y2 += drive_squared;
    self->p2 += parameter_squared;
    self->open_s += dt_s;
    self->rows++;
    return self->open_s >= DRIVEID_MONITOR_BLOCK_S ? close_block(self) : 0;
}
