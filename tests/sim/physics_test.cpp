// SPDX-License-Identifier: Apache-2.0
// The plant against closed solutions and conservation laws.
#include <gtest/gtest.h>

#include <cmath>

#include "plant.hpp"

namespace {

constexpr double STEP = 1.0 / 32000;  // the step of every record

sim::Drive motor() {
    sim::Drive d;
    d.J = 1e-4; d.B = 2e-4; d.K_t = d.K_e = 0.05; d.R = 0.5; d.L = 1e-3; d.I_rated = 5;
    return d;
}

// A drive whose shaft feels no current: mechanics alone.
sim::Drive free_shaft() {
    sim::Drive d = motor();
    d.B = 0; d.K_t = d.K_e = 1e-12;
    return d;
}

// Speed of a DC motor after a voltage step, from the two eigenvalues of its linear equations.
double motor_step(const sim::Drive &d, double v, double t) {
    const double a = d.R / d.L, b = d.B / d.J, c = d.K_t * d.K_e / (d.J * d.L);
    const double root = std::sqrt((a - b) * (a - b) / 4 - c), s1 = -(a + b) / 2 + root, s2 = -(a + b) / 2 - root;
    const double gain = d.K_t * v / (d.J * d.L);
    return gain * (1 / (s1 * s2) + std::exp(s1 * t) / (s1 * (s1 - s2)) + std::exp(s2 * t) / (s2 * (s2 - s1)));
}

double step_error(double h) {
    const auto d = motor();
    sim::Plant plant(d, {}, h, 1);
    double worst = 0;
    while (plant.state().t < 0.1 - h / 2) {
        plant.step(10, 0);
        worst = std::max(worst, std::fabs(plant.state().w - motor_step(d, 10, plant.state().t)));
    }
    return worst;
}

TEST(Plant, MotorStepIsTheClosedSolution) {
    const double top = motor_step(motor(), 10, 10);
    EXPECT_NEAR(top, 0.05 * 10 / (0.5 * 2e-4 + 0.05 * 0.05), 1e-6 * top);  // the closed form is the known static gain
    EXPECT_LT(step_error(STEP), 2e-5 * top);
}

TEST(Plant, ErrorFallsWithTheSquareOfTheStep) {
    const double coarse = step_error(8 * STEP), middle = step_error(4 * STEP), fine = step_error(2 * STEP);
    EXPECT_GT(coarse / middle, 3.0);  // 4 in the limit; start-up from rest costs the first step some
    EXPECT_GT(middle / fine, 3.0);
    EXPECT_LT(coarse / middle, 5.0);
}

TEST(Plant, TwoMassesSwingAtTheirFrequency) {
    sim::Hidden x;
    const auto d = free_shaft();
    x.load_share = 0.4;
    const double J_l = 0.4 * d.J, J_m = 0.6 * d.J, f = 40;
    x.spring = std::pow(2 * M_PI * f, 2) * J_m * J_l / (J_m + J_l);
    sim::Plant plant(d, x, STEP, 1);
    plant.state().q = 0.01;
    int turns = 0;
    double last = 1, first_t = -1, last_t = 0;
    for (int n = 0; n < 32000 * 4; ++n) {
        plant.step(0, 0);
        const double twist = plant.state().q - plant.state().q_l;
        if (last < 0 && twist >= 0) {
            last_t = plant.state().t - STEP * twist / (twist - last);
            if (first_t < 0) first_t = last_t; else ++turns;
        }
        last = twist;
    }
    EXPECT_NEAR(turns / (last_t - first_t), f, 1e-4 * f);
    EXPECT_NEAR(J_m * plant.state().q + J_l * plant.state().q_l, J_m * 0.01, 1e-9 * d.J);  // centre of mass rests
}

// Work put in by the current = change of kinetic energy + heat of friction, through reversals and standstills.
TEST(Plant, EnergyBalances) {
    const auto d = motor();
    sim::Hidden x;
    x.tau_c = 0.02; x.tau_s = 0.03; x.omega_s = 5; x.drag = 2e-6;
    sim::Plant plant(d, x, STEP, 1);
    double work = 0;
    for (int n = 0; n < 64000; ++n) {
        const double q = plant.state().q, torque = plant.electric_torque();
        plant.step(6 * std::sin(2 * M_PI * 3 * plant.state().t), 0);
        work += 0.5 * (torque + plant.electric_torque()) * (plant.state().q - q);
    }
    const double kinetic = 0.5 * d.J * plant.state().w * plant.state().w;
    ASSERT_GT(work, 1.0);
    EXPECT_NEAR(work, kinetic + plant.dissipated_J(), 2e-3 * work);
}

TEST(Plant, SticksExactlyAndBreaksAwayAtItsLevel) {
    auto d = motor();
    d.K_e = 1e-12;
    sim::Hidden x;
    x.tau_c = 0.02; x.tau_s = 0.03; x.omega_s = 5;
    sim::Plant below(d, x, STEP, 1), above(d, x, STEP, 1);
    for (int n = 0; n < 32000; ++n) {
        below.step(0.5 * 0.0299 / 0.05, 0);  // v = R tau / K_t
        above.step(0.5 * 0.032 / 0.05, 0);
    }
    EXPECT_EQ(below.state().q, 0.0);
    EXPECT_EQ(below.state().w, 0.0);
    EXPECT_GT(above.state().w, 10.0);
    for (int n = 0; n < 32000; ++n) above.step(0, 0);  // runs down, then stands: no creeping, no chatter
    const double q = above.state().q;
    EXPECT_EQ(above.state().w, 0.0);
    for (int n = 0; n < 3200; ++n) above.step(0.5 * 0.0299 / 0.05 * ((n / 40) % 2 ? 1 : -1), 0);
    EXPECT_EQ(above.state().q, q);
}

// Sliding to rest under Coulomb friction alone takes J w / tau_c seconds and w^2 J / (2 tau_c) radians.
TEST(Plant, SlidesToRestInTheKnownTimeAndWay) {
    const auto d = free_shaft();
    sim::Hidden x;
    x.tau_c = 0.01;
    sim::Plant plant(d, x, STEP, 1);
    plant.state().w = 50; plant.state().mode = 1;
    double stopped = 0;
    while (stopped == 0 && plant.state().t < 2) { plant.step(0, 0); if (plant.state().w == 0) stopped = plant.state().t; }
    EXPECT_NEAR(stopped, d.J * 50 / 0.01, 2 * STEP);
    EXPECT_NEAR(plant.state().q, 50 * 50 * d.J / (2 * 0.01), 1e-6);
}

TEST(Plant, GapIsFreeAndImpactsLoseEnergyNotMomentum) {
    const auto d = free_shaft();
    sim::Hidden x;
    x.load_share = 0.5; x.gap = 0.02;
    x.spring = 0.25 * d.J * std::pow(2 * M_PI * 250, 2);
    x.spring_damper = 0.3 * 0.25 * d.J * 2 * M_PI * 250;
    sim::Plant plant(d, x, STEP, 1);
    plant.state().w = 10;
    double energy = 0.5 * 0.5 * d.J * 100, lowest = energy;
    for (int n = 0; n < 31; ++n) plant.step(0, 0);  // 0.97 ms at 10 rad/s: still inside the gap of +-0.01
    EXPECT_EQ(plant.state().w_l, 0.0);
    for (int n = 0; n < 32000; ++n) {
        plant.step(0, 0);
        const auto &s = plant.state();
        EXPECT_NEAR(s.w + s.w_l, 10, 1e-6);
        const double half = 0.5 * x.gap, depth = std::max(std::fabs(s.q - s.q_l) - half, 0.0);
        energy = 0.25 * d.J * (s.w * s.w + s.w_l * s.w_l) + 0.5 * x.spring * depth * depth;
        EXPECT_LT(energy, lowest * (1 + 1e-4));  // error of the midpoint rule in the stiff contact; an impact loses percents
        lowest = std::min(lowest, energy);
    }
    EXPECT_LT(energy, 0.9 * 0.25 * d.J * 100);  // impacts lost something
    EXPECT_GT(energy, 0.5 * 0.25 * d.J * 100 * (1 - 1e-6));  // never below the common motion
}

TEST(Plant, DelayMovesTheResponseByItsTime) {
    const auto d = motor();
    sim::Hidden x;
    x.delay_s = 64 * STEP;
    sim::Plant late(d, x, STEP, 1), now(d, {}, STEP, 1);
    int first_late = 0, first_now = 0;
    for (int n = 1; n < 200; ++n) {
        late.step(10, 0); now.step(10, 0);
        if (!first_late && late.state().w != 0) first_late = n;
        if (!first_now && now.state().w != 0) first_now = n;
    }
    EXPECT_EQ(first_late - first_now, 64);
}

TEST(Plant, BristlesGiveBeforeTheySlide) {
    auto d = motor();
    d.K_e = 1e-12;
    sim::Hidden x;
    x.lugre_c = 0.02; x.lugre_s = 0.03; x.lugre_w = 5; x.lugre_k = 10;
    x.lugre_d = 2 * std::sqrt(10 * d.J);
    sim::Plant plant(d, x, STEP, 1);
    for (int n = 0; n < 64000; ++n) plant.step(0.5 * 0.01 / 0.05, 0);  // a third of the breakaway torque
    EXPECT_NEAR(plant.state().q, 0.01 / 10, 0.02 * 0.01 / 10 + 0.0005 * (2 * 0.01 / 0.03));  // spring, and the steady bristle's bend
    EXPECT_NEAR(plant.state().w, 0, 1e-3);
    for (int n = 0; n < 96000; ++n) plant.step(0, 0);
    EXPECT_LT(std::fabs(plant.state().q), 0.6e-3);  // springs back, but for what slipped
}

TEST(Plant, HysteresisForgetsItsRateNotItsWay) {
    double end[2];
    for (int fast = 0; fast < 2; ++fast) {
        const auto d = free_shaft();
        sim::Hidden x;
        x.dahl = 1e-9; x.dahl_span = 0.1;  // too weak to slow the shaft: speed is given
        sim::Plant plant(d, x, STEP, 1);
        plant.state().w = fast ? 10 : 1;
        while (plant.state().q < 0.2) plant.step(0, 0);
        end[fast] = plant.state().dahl;
    }
    EXPECT_NEAR(end[0], 1e-9 * (1 - std::exp(-2.0)), 1e-12);
    EXPECT_NEAR(end[1], end[0], 1e-12);
}

TEST(Plant, SteadyVoltageHasTheInverterLossAndTheHeat) {
    auto d = motor();
    d.K_t = d.K_e = 1e-12;
    sim::Hidden x;
    x.dead_voltage = 0.4; x.heat_rise = 100; x.heat_tau_s = 0.2;
    sim::Plant plant(d, x, STEP, 1);
    for (int n = 0; n < 64000; ++n) plant.step(4, 0);
    const double i = plant.state().i, heat = 100 * i * i / 25;
    EXPECT_NEAR(plant.state().heat, heat, 1e-3 * heat);
    EXPECT_NEAR(4, 0.4 + 0.5 * (1 + 0.0039 * heat) * i, 1e-3);
}

TEST(Plant, SynchronousMotorReachesItsSteadyState) {
    auto d = motor();
    d.pmsm = true; d.pole_pairs = 4; d.psi = 0.01; d.L_d = 1e-3; d.L_q = 1.4e-3; d.K_t = 1.5 * 4 * 0.01;
    sim::Plant plant(d, {}, STEP, 1);
    for (int n = 0; n < 32000 * 3; ++n) plant.step(5, -1);
    const auto &s = plant.state();
    const double w_e = 4 * s.w;
    EXPECT_NEAR(-1, 0.5 * s.i_d - w_e * d.L_q * s.i, 1e-3);
    EXPECT_NEAR(5, 0.5 * s.i + w_e * (d.L_d * s.i_d + d.psi), 1e-3);
    EXPECT_NEAR(d.B * s.w, 1.5 * 4 * (d.psi + (d.L_d - d.L_q) * s.i_d) * s.i, 1e-4 * d.B * s.w);
}

TEST(Plant, CrankInertiaKeepsItsEnergy) {
    const auto d = free_shaft();
    sim::Hidden x;
    x.inertia_wave = 0.3; x.inertia_wave_order = 2;
    sim::Plant plant(d, x, STEP, 1);
    plant.state().w = 20;
    const double energy = 0.5 * d.J * 1.3 * 400;
    for (int n = 0; n < 64000; ++n) {
        plant.step(0, 0);
        const auto &s = plant.state();
        const double J = d.J * (1 + 0.3 * std::cos(2 * s.q));
        ASSERT_NEAR(0.5 * J * s.w * s.w, energy, 1e-4 * energy);
    }
}

}  // namespace
