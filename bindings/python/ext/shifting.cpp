// SPDX-License-Identifier: Apache-2.0
// fsm.h: frequency shifting in its full form over a whole record.
#include "records.hpp"

#include <algorithm>
#include <memory>

#include <driveid/fsm.h>

namespace driveid_ext {
namespace {

driveid_fsm_config config_of(int order, int zeros, int fixed_mask, int hold_y, int hold_u) {
    if (order < 1 || order > DRIVEID_FSM_ORDER_MAX || zeros < -1 || zeros > order) throw nb::value_error("order must be 1 .. 6 and zeros -1 (no input) .. order");
    if (fixed_mask < 0 || fixed_mask > 255 || hold_y < 0 || hold_y > 255 || hold_u < 0 || hold_u > 255) throw nb::value_error("fixed and holds must be 0 .. 255");
    driveid_fsm_config c{};
    c.order = uint8_t(order), c.zeros = uint8_t(zeros < 0 ? DRIVEID_FSM_AUTONOMOUS : zeros), c.fixed_mask = uint8_t(fixed_mask), c.hold_y = uint8_t(hold_y), c.hold_u = uint8_t(hold_u);
    return c;
}

// (poles, q)
std::pair<std::vector<double>, double> suggest(int order, int zeros, int fixed_mask, double dt_s, double bandwidth_rad_s, double noise) {
    driveid_fsm_config c = config_of(order, zeros, fixed_mask, 0, 0);
    std::string reason(200, '\0');
    if (driveid_fsm_suggest(&c, dt_s, bandwidth_rad_s, noise, reason.data(), reason.size())) throw nb::value_error(reason.c_str());
    return {{c.pole_rad_s, c.pole_rad_s + c.poles}, c.q_per_s};
}

// (status, a, b, c, condition) at the end of the record; zeros -1: no input.
std::tuple<int, std::vector<double>, std::vector<double>, std::vector<double>, double> identify(const Stamps &t_ns, const Values &y, const Values &u, int order, int zeros, int fixed_mask, int hold_y, int hold_u,
                                                                                                 const std::vector<double> &poles, double q_per_s) {
    if (t_ns.shape(0) != y.shape(0) || t_ns.shape(0) != u.shape(0)) throw nb::value_error("y and u must have as many rows as t_ns");
    if (poles.size() > DRIVEID_FSM_POLES_MAX) throw nb::value_error("poles must be order + 1 .. 8");
    driveid_fsm_config c = config_of(order, zeros, fixed_mask, hold_y, hold_u);
    c.poles = uint8_t(poles.size()), c.q_per_s = q_per_s;
    std::copy(poles.begin(), poles.end(), c.pole_rad_s);
    const auto e = std::make_unique<driveid_fsm_f64>();
    std::string reason(200, '\0');
    if (driveid_fsm_configure_f64(e.get(), &c, reason.data(), reason.size())) throw nb::value_error(reason.c_str());
    driveid_fsm_estimate out{};
    driveid_status status;
    {
        nb::gil_scoped_release release;
        for (size_t k = 0; k < y.shape(0); k++) driveid_fsm_update_f64(e.get(), t_ns.data()[k], y.data()[k], u.data()[k]);
        status = driveid_fsm_estimate_f64(e.get(), &out);
    }
    if (status) return {status, {}, {}, {}, 0.0};
    return {status, {out.a, out.a + order}, {out.b, out.b + (zeros + 1)}, {out.c, out.c + order}, out.condition};
}

}  // namespace

void bind_shifting(nb::module_ &m) {
    m.def("shifting_suggest", &suggest, nb::arg("order"), nb::arg("zeros"), nb::arg("fixed_mask"), nb::arg("dt_s"), nb::arg("bandwidth_rad_s"), nb::arg("noise"));
    m.def("shifting_identify", &identify, nb::arg("t_ns"), nb::arg("y"), nb::arg("u"), nb::arg("order"), nb::arg("zeros"), nb::arg("fixed_mask"), nb::arg("hold_y"), nb::arg("hold_u"), nb::arg("poles_rad_s"), nb::arg("q_per_s"));
}

}  // namespace driveid_ext
