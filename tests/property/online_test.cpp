// SPDX-License-Identifier: Apache-2.0
// Structures on line against known-truth drives: values inside their intervals, and what cannot be had is named.
#include <gtest/gtest.h>

#include <cstring>
#include <string>
#include <vector>

#include "plants.hpp"
#include <driveid/model.h>

namespace {

using plants::Rng;

struct Online {
    driveid_online online{};
    std::vector<unsigned char> memory;
    driveid_estimator *estimator() { return reinterpret_cast<driveid_estimator *>(memory.data()); }

    Online(const driveid_model &model, std::initializer_list<driveid_signal> signals, double dt_s, driveid_real type = DRIVEID_F64,
           std::initializer_list<std::pair<driveid_signal, driveid_hold>> holds = {}) {
        uint32_t bits = 0;
        char reason[200];
        for (auto s : signals) bits |= 1u << s;
        EXPECT_EQ(driveid_online_init(&online, &model, bits, reason, sizeof reason), DRIVEID_OK) << reason;
        for (auto [s, h] : holds) EXPECT_EQ(driveid_online_hold(&online, s, h), DRIVEID_OK);
        memory.resize(driveid_estimator_size("fsm", type));
        driveid_estimator_options options{};
        options.dt_s = dt_s;
        EXPECT_EQ(driveid_estimator_configure(estimator(), memory.size(), "fsm", type, &online.regression, &options, reason, sizeof reason), DRIVEID_OK) << reason;
    }
    driveid_status feed(int64_t t_ns, std::initializer_list<std::pair<driveid_signal, double>> values) {
        driveid_sample sample{};
        double channel[DRIVEID_CHANNELS_MAX];
        sample.stamp = {t_ns, 0, DRIVEID_CLOCK_RECORD};
        for (auto [s, v] : values) sample.present |= 1u << s, sample.value[s] = v;
        const driveid_status status = driveid_online_channels(&online, &sample, channel);
        return status ? status : driveid_estimator_update(estimator(), online.t_ns, channel);
    }
    driveid_param get(const std::string &name, double *valid = nullptr) {
        driveid_estimate e{};
        driveid_param p[DRIVEID_THETA_MAX]{};
        uint32_t mask = 0;
        const driveid_status s = driveid_estimator_estimate(estimator(), &e);
        EXPECT_GE(s, 0);
        EXPECT_EQ(driveid_online_physical(&online, &e, p, &mask), DRIVEID_OK) << driveid_status_text(s);
        for (uint32_t i = 0; i < online.physical; i++)
            if (name == p[i].name) {
                if (valid) *valid = mask >> i & 1;
                return p[i];
            }
        ADD_FAILURE() << "no parameter " << name;
        return {};
    }
    // Within 5 % of the truth and within three half-widths, the product's own promise.
    void expect(const std::string &name, double truth) {
        double valid = 0;
        const driveid_param p = get(name, &valid);
        EXPECT_EQ(valid, 1) << name;
        EXPECT_NEAR(p.value, truth, 0.05 * std::fabs(truth)) << name << " [" << p.lo << ", " << p.hi << "]";
        EXPECT_NEAR(p.value, truth, 3 * (p.hi - p.lo) / 2) << name << " [" << p.lo << ", " << p.hi << "]";
    }
};

driveid_model model_of(driveid_structure structure, std::initializer_list<std::pair<const char *, double>> given, std::initializer_list<const char *> effects = {}) {
    driveid_model m;
    char reason[200];
    EXPECT_EQ(driveid_model_init(&m, structure), DRIVEID_OK);
    for (auto [name, value] : given) EXPECT_EQ(driveid_model_give(&m, name, value), DRIVEID_OK) << name;
    for (auto e : effects) EXPECT_EQ(driveid_model_add(&m, e, nullptr, nullptr, reason, sizeof reason), DRIVEID_OK) << reason;
    return m;
}

constexpr int64_t ms = 1000000;

TEST(Online, RigidAxisWithFrictionAndLoad) {
    for (uint64_t seed = 1; seed <= 20; seed++) {
        Rng g(seed);
        plants::Axis axis{plants::log_uniform(g, 3e-5, 3e-3), 0};
        axis.B = axis.J * plants::uniform(g, 0.5, 3);
        const double amplitude = axis.J * 300;
        axis.tau_c = amplitude * 0.15, axis.tau_0 = amplitude * 0.05;
        const double f1 = plants::uniform(g, 0.4, 0.9), f2 = plants::uniform(g, 1.1, 2.5), K_t = 0.07;
        Online o(model_of(DRIVEID_STRUCTURE_RIGID_AXIS, {{"K_t_Nm_A", K_t}}, {"coulomb", "constant_load"}),
                 {DRIVEID_SIGNAL_I_Q_A, DRIVEID_SIGNAL_THETA_RAD}, 1e-3, DRIVEID_F64, {{DRIVEID_SIGNAL_I_Q_A, DRIVEID_HOLD_ZERO}});
        for (int k = 0; k < 10000; k++) {
            const double t = k * 1e-3, tau = amplitude * (0.6 * std::sin(6.2832 * f1 * t) + 0.6 * std::sin(6.2832 * f2 * t + 1));
            o.feed(1 + k * ms, {{DRIVEID_SIGNAL_I_Q_A, tau / K_t}, {DRIVEID_SIGNAL_THETA_RAD, axis.theta + 1e-4 * plants::gauss(g)}});
            axis.step(tau, 1e-3);
        }
        SCOPED_TRACE(seed);
        o.expect("J_kgm2", axis.J);
        o.expect("B_Nms_rad", axis.B);
        o.expect("tau_c_Nm", axis.tau_c);
        o.expect("tau_0_Nm", axis.tau_0);
    }
}

TEST(Online, PerAmpereWithoutTorqueConstant) {
    Rng g(7);
    plants::Axis axis{2e-4, 4e-4};
    Online o(model_of(DRIVEID_STRUCTURE_RIGID_AXIS, {}), {DRIVEID_SIGNAL_I_A, DRIVEID_SIGNAL_OMEGA_RAD_S}, 1e-3, DRIVEID_F64, {{DRIVEID_SIGNAL_I_A, DRIVEID_HOLD_ZERO}});
    for (int k = 0; k < 8000; k++) {
        const double i = std::sin(0.006 * k) + std::sin(0.0017 * k);
        o.feed(1 + k * ms, {{DRIVEID_SIGNAL_I_A, i}, {DRIVEID_SIGNAL_OMEGA_RAD_S, axis.omega + 0.05 * plants::gauss(g)}});
        axis.step(0.05 * i, 1e-3);
    }
    o.expect("J_As2_rad", axis.J / 0.05);
    o.expect("B_As_rad", axis.B / 0.05);
    EXPECT_NE(std::string(o.online.missing).find("K_t_Nm_A"), std::string::npos);
}

TEST(Online, DcDriveBothSets) {
    Rng g(3);
    const double R = 1.2, L = 2.5e-3, K = 0.06, J = 1.5e-4, B = 2e-4;
    std::array<double, 3> x{0, 0, 0}; // i, omega, theta
    double v = 0;
    Online o(model_of(DRIVEID_STRUCTURE_DC_DRIVE, {{"K_t_Nm_A", K}}), {DRIVEID_SIGNAL_V_V, DRIVEID_SIGNAL_I_A, DRIVEID_SIGNAL_THETA_RAD}, 1e-3, DRIVEID_F64,
             {{DRIVEID_SIGNAL_V_V, DRIVEID_HOLD_ZERO}});
    for (int k = 0; k < 8000; k++) {
        if (k % 37 == 0) v = plants::uniform(g, -12, 12);
        o.feed(1 + k * ms, {{DRIVEID_SIGNAL_V_V, v}, {DRIVEID_SIGNAL_I_A, x[0] + 2e-3 * plants::gauss(g)}, {DRIVEID_SIGNAL_THETA_RAD, x[2] + 1e-4 * plants::gauss(g)}});
        plants::rk4<3>(x, 1e-3, 10, [&](const auto &s) { return std::array<double, 3>{(v - R * s[0] - K * s[1]) / L, (K * s[0] - B * s[1]) / J, s[1]}; });
    }
    for (auto [name, truth] : {std::pair{"R_ohm", R}, {"L_H", L}, {"K_e_Vs_rad", K}, {"J_kgm2", J}, {"B_Nms_rad", B}}) o.expect(name, truth);
}

TEST(Online, PmsmInDq) {
    Rng g(4);
    const double R = 0.6, L_d = 1.8e-3, L_q = 2.6e-3, psi = 0.03, J = 2e-4, B = 3e-4, p = 4;
    std::array<double, 4> x{0, 0, 0, 0}; // i_d, i_q, omega, theta
    double v_d = 0, v_q = 0;
    Online o(model_of(DRIVEID_STRUCTURE_PMSM_DRIVE, {{"pole_pairs", p}}),
             {DRIVEID_SIGNAL_V_D_V, DRIVEID_SIGNAL_V_Q_V, DRIVEID_SIGNAL_I_D_A, DRIVEID_SIGNAL_I_Q_A, DRIVEID_SIGNAL_THETA_RAD}, 2.5e-4, DRIVEID_F64,
             {{DRIVEID_SIGNAL_V_D_V, DRIVEID_HOLD_ZERO}, {DRIVEID_SIGNAL_V_Q_V, DRIVEID_HOLD_ZERO}});
    for (int k = 0; k < 32000; k++) {
        if (k % 83 == 0) v_d = plants::uniform(g, -4, 4), v_q = plants::uniform(g, -10, 10);
        o.feed(1 + k * ms / 4, {{DRIVEID_SIGNAL_V_D_V, v_d}, {DRIVEID_SIGNAL_V_Q_V, v_q}, {DRIVEID_SIGNAL_I_D_A, x[0] + 2e-3 * plants::gauss(g)},
                            {DRIVEID_SIGNAL_I_Q_A, x[1] + 2e-3 * plants::gauss(g)}, {DRIVEID_SIGNAL_THETA_RAD, x[3] + 1e-4 * plants::gauss(g)}});
        plants::rk4<4>(x, 2.5e-4, 5, [&](const auto &s) {
            const double we = p * s[2], torque = 1.5 * p * (psi * s[1] + (L_d - L_q) * s[0] * s[1]);
            return std::array<double, 4>{(v_d - R * s[0] + we * L_q * s[1]) / L_d, (v_q - R * s[1] - we * (L_d * s[0] + psi)) / L_q, (torque - B * s[2]) / J, s[2]};
        });
    }
    for (auto [name, truth] : {std::pair{"R_ohm", R}, {"L_d_H", L_d}, {"L_q_H", L_q}, {"psi_pm_Vs", psi}, {"J_kgm2", J}, {"B_Nms_rad", B}}) o.expect(name, truth);
}

} // namespace
