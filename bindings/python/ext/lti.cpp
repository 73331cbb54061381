// SPDX-License-Identifier: Apache-2.0
// lti.h and control.h: transfer functions from records, what they mean, and a controller for them.
#include "records.hpp"

#include <algorithm>

#include <driveid/control.h>
#include <driveid/lti.h>

namespace driveid_ext {
namespace {

using Plant = driveid_lti_model;

driveid_lti_method method_of(const std::string &name) {
    const char *names[] = {"ls", "tls", "iv", "srivc", "oe"};
    for (int k = 0; k < 5; k++)
        if (name == names[k]) return static_cast<driveid_lti_method>(k);
    throw nb::value_error(("method is \"ls\", \"tls\", \"iv\", \"srivc\" or \"oe\", not \"" + name + "\"").c_str());
}

driveid_lti_task task_of(const Values &y, const Values &u, double T_s, size_t order, size_t zeros, size_t delay, bool zoh, bool initial_conditions, const std::string &method,
                         double bandwidth_rad_s) {
    if (y.shape(0) != u.shape(0)) throw nb::value_error("y and u have not as many samples");
    driveid_lti_task t{};
    t.order = order, t.zeros = zeros, t.delay = delay, t.T_s = T_s, t.rows = y.shape(0), t.y = y.data(), t.u = u.data();
    t.hold = zoh ? DRIVEID_HOLD_ZERO : DRIVEID_HOLD_FIRST;
    t.initial_conditions = initial_conditions, t.method = method_of(method), t.bandwidth_rad_s = bandwidth_rad_s;
    return t;
}

nb::object values(const double *from, size_t count) { return array(Array(from, from + count), {count}); }

nb::dict modes_of(const Plant &p) {
    driveid_lti_modes m;
    must("modes", driveid_lti_modes_of(&p, &m));
    nb::dict d;
    d["poles"] = complexes(Array(m.pole_re, m.pole_re + m.poles), Array(m.pole_im, m.pole_im + m.poles));
    d["zeros"] = complexes(Array(m.zero_re, m.zero_re + m.zeros), Array(m.zero_im, m.zero_im + m.zeros));
    d["omega_rad_s"] = values(m.omega_rad_s, m.poles);
    d["omega_half"] = values(m.omega_half, m.poles);
    d["zeta"] = values(m.zeta, m.poles);
    d["zeta_half"] = values(m.zeta_half, m.poles);
    d["gain"] = m.gain;
    d["gain_half"] = m.gain_half;
    return d;
}

driveid_controller controller_of(double T_s, double gain, double zero_rad_s, const std::vector<std::tuple<double, double, double>> &notches) {
    if (notches.size() > DRIVEID_NOTCH_MAX) throw nb::value_error("a controller has at most 4 notches");
    driveid_controller c{};
    c.T_s = T_s, c.gain = gain, c.zero_rad_s = zero_rad_s, c.notches = notches.size();
    for (size_t k = 0; k < notches.size(); k++) c.notch[k] = {std::get<0>(notches[k]), std::get<1>(notches[k]), std::get<2>(notches[k])};
    return c;
}

void bind_plant(nb::module_ &m) {
    nb::class_<Plant>(m, "Lti")
        .def(nb::init<const Plant &>())
        .def_ro("order", &Plant::order)
        .def_ro("delay", &Plant::delay)
        .def_ro("T_s", &Plant::T_s)
        .def_ro("noise_sd", &Plant::noise_sd)
        .def_ro("fit_percent", &Plant::fit_percent)
        .def_ro("bic", &Plant::bic)
        .def_ro("iterations", &Plant::iterations)
        .def_prop_ro("converged", [](const Plant &p) { return p.converged != 0; })
        .def_prop_ro("a", [](const Plant &p) { return values(p.a, p.order); })
        .def_prop_ro("b", [](const Plant &p) { return values(p.b, p.zeros + 1); })
        .def_prop_ro("cov", [](const Plant &p) {
            const size_t k = p.order + p.zeros + 1;
            return array(Array(p.cov, p.cov + k * k), {k, k});
        })
        .def("modes", &modes_of)
        .def("frequency", [](const Plant &p, const Values &omega) {
            Array re(omega.shape(0)), im(omega.shape(0));
            must("frequency", driveid_lti_frequency(&p, re.size(), omega.data(), re.data(), im.data()));
            return complexes(re, im);
        })
        .def("to_z", [](const Plant &p, double T_s) {
            Array az(p.order), bz(p.order);
            must("to_z", driveid_lti_to_z(&p, T_s, az.data(), bz.data()));
            return std::pair(values(az.data(), az.size()), values(bz.data(), bz.size()));
        });
    m.def("lti_of", [](const Values &a, const Values &b, double T_s, size_t delay) {
        if (a.shape(0) < 1 || a.shape(0) > DRIVEID_LTI_ORDER_MAX || b.shape(0) < 1 || b.shape(0) > a.shape(0))
            throw nb::value_error("a has 1 to 8 coefficients (a_0 first, leading 1 left out), b at least one and at most as many");
        Plant p{};
        p.order = a.shape(0), p.zeros = b.shape(0) - 1, p.delay = delay, p.T_s = T_s;
        std::copy_n(a.data(), p.order, p.a);
        std::copy_n(b.data(), p.zeros + 1, p.b);
        return p;
    });
    m.def("lti_from_z", [](const Values &az, const Values &bz, double T_s) {
        if (az.shape(0) != bz.shape(0)) throw nb::value_error("az and bz have the same number of coefficients");
        Plant p{};
        must("from_z", driveid_lti_from_z(az.shape(0), az.data(), bz.data(), T_s, &p));
        return p;
    });
    m.def("lti_z_to_q", [](const Values &az, const Values &bz, double T_s) {
        if (az.shape(0) != bz.shape(0)) throw nb::value_error("az and bz have the same number of coefficients");
        Array A(az.shape(0)), B(az.shape(0) + 1);
        must("z_to_q", driveid_lti_z_to_q(A.size(), az.data(), bz.data(), T_s, A.data(), B.data()));
        return std::pair(values(A.data(), A.size()), values(B.data(), B.size()));
    });
}

void bind_fit(nb::module_ &m) {
    m.def("lti_fit", [](const Values &y, const Values &u, double T_s, size_t order, size_t zeros, size_t delay, bool zoh, bool initial_conditions, const std::string &method, double bandwidth_rad_s) {
        const auto task = task_of(y, u, T_s, order, zeros, delay, zoh, initial_conditions, method, bandwidth_rad_s);
        Plant p{};
        driveid_status status;
        {
            nb::gil_scoped_release free;
            status = driveid_lti_fit(&task, &p);
        }
        must("lti fit", status);
        return p;
    });
    m.def("lti_search", [](const Values &y, const Values &u, double T_s, size_t order_max, size_t zeros_max, size_t delay_max, bool zoh, bool initial_conditions, const std::string &method, double bandwidth_rad_s) {
        const auto task = task_of(y, u, T_s, order_max, zeros_max, 0, zoh, initial_conditions, method, bandwidth_rad_s);
        Plant p{};
        driveid_status status;
        {
            nb::gil_scoped_release free;
            status = driveid_lti_search(&task, delay_max, &p);
        }
        must("lti search", status);
        return p;
    });
}

void bind_controller(nb::module_ &m) {
    using Controller = driveid_controller;
    nb::class_<Controller>(m, "Controller")
        .def("__init__", [](Controller *self, double T_s, double gain, double zero_rad_s, const std::vector<std::tuple<double, double, double>> &notches) {
            new (self) Controller(controller_of(T_s, gain, zero_rad_s, notches));
        })
        .def_ro("T_s", &Controller::T_s)
        .def_ro("gain", &Controller::gain)
        .def_ro("zero_rad_s", &Controller::zero_rad_s)
        .def_prop_ro("notches", [](const Controller &c) {
            std::vector<std::tuple<double, double, double>> out;
            for (size_t k = 0; k < c.notches; k++) out.emplace_back(c.notch[k].omega_rad_s, c.notch[k].zeta_from, c.notch[k].zeta_to);
            return out;
        })
        .def("sections", [](const Controller &c) {
            Array out(5 * (1 + c.notches));
            must("sections", driveid_controller_sections(&c, reinterpret_cast<double(*)[5]>(out.data())));
            return array(std::move(out), {1 + c.notches, 5});
        })
        .def("frequency", [](const Controller &c, const Plant &p, const Values &omega) {
            Array re(omega.shape(0)), im(omega.shape(0));
            must("open loop", driveid_loop_frequency(&p, &c, re.size(), omega.data(), re.data(), im.data()));
            return complexes(re, im);
        })
        .def("margins", [](const Controller &c, const Plant &p) {
            driveid_loop_margins g;
            must("margins", driveid_loop_margins_of(&p, &c, &g));
            return std::tuple(g.crossover_rad_s, g.phase_margin_deg, g.phase_crossover_rad_s, g.gain_margin_db, g.stable != 0);
        })
        .def("step", [](const Controller &c, const Plant &p, size_t count) {
            Array y(count);
            driveid_step_figures f{};
            must("step", driveid_loop_step(&p, &c, count, y.data(), &f));
            return std::tuple(array(std::move(y), {count}), f.t90_s, f.overshoot_percent, f.settling_s);
        });
    m.def("loop_design", [](const Plant &p, double T_s, double phase_margin_deg, double crossover_rad_s, double notch_below_zeta, double notch_widen) {
        const driveid_loop_wish wish{T_s, phase_margin_deg, crossover_rad_s, notch_below_zeta, notch_widen};
        Controller c{};
        double reachable = 0;
        const driveid_status status = driveid_loop_design(&p, &wish, &c, &reachable);
        if (status == DRIVEID_ERR_DATA && crossover_rad_s > 0)
            throw nb::value_error(("no PI controller with notches reaches that phase margin there; at this crossover at most " + std::to_string(reachable) + " degrees: ask for a slower one").c_str());
        must("loop design", status);
        return c;
    });
}

}  // namespace

void bind_lti(nb::module_ &m) {
    bind_plant(m);
    bind_fit(m);
    bind_controller(m);
}

}  // namespace driveid_ext
