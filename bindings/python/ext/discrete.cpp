// SPDX-License-Identifier: Apache-2.0
// discrete.h: algebraic identification in z or q, block by block over a whole record.
#include "records.hpp"

#include <memory>

#include <driveid/discrete.h>

namespace driveid_ext {
namespace {

using Doubles = std::vector<double>;

driveid_discrete_config config_of(bool q_domain, int order, int zeros, int kept, int skipped, int extra, size_t block, double T_s, double gamma) {
    for (const int n : {order, zeros, kept, skipped, extra})
        if (n < 0 || n > 255) throw nb::value_error("order, zeros, kept, skipped and extra must be 0 .. 255");
    if (block > 1000000) throw nb::value_error("block must be 4 order .. 100000");
    return {q_domain ? DRIVEID_DISCRETE_Q : DRIVEID_DISCRETE_Z, uint8_t(order), uint8_t(zeros), uint8_t(kept), uint8_t(skipped), uint8_t(extra), uint32_t(block), T_s, gamma};
}

// (status, blocks, last, mean, lo, hi) at the end of the record.
std::tuple<int, uint32_t, Doubles, Doubles, Doubles, Doubles> identify(const Values &y, const Values &u, bool q_domain, int order, int zeros, int kept, int skipped, int extra, size_t block, double T_s,
                                                                        double gamma) {
    if (y.shape(0) != u.shape(0)) throw nb::value_error("y and u must have as many rows");
    const driveid_discrete_config c = config_of(q_domain, order, zeros, kept, skipped, extra, block, T_s, gamma);
    const auto e = std::make_unique<driveid_discrete_f64>();
    std::string reason(200, '\0');
    if (driveid_discrete_configure_f64(e.get(), &c, reason.data(), reason.size())) throw nb::value_error(reason.c_str());
    driveid_discrete_estimate out{};
    driveid_status status;
    {
        nb::gil_scoped_release release;
        for (size_t k = 0; k < y.shape(0); k++) (void)driveid_discrete_update_f64(e.get(), y.data()[k], u.data()[k]);
        status = driveid_discrete_estimate_f64(e.get(), &out);
    }
    const auto row = [&](const double *x) { return status ? Doubles{} : Doubles{x, x + out.params}; };
    return {status, out.blocks, row(out.theta), row(out.mean), row(out.lo), row(out.hi)};
}

}  // namespace

void bind_discrete(nb::module_ &m) {
    m.def("discrete_identify", &identify, nb::arg("y"), nb::arg("u"), nb::arg("q_domain"), nb::arg("order"), nb::arg("zeros"), nb::arg("kept"), nb::arg("skipped"), nb::arg("extra"), nb::arg("block"), nb::arg("T_s"),
          nb::arg("gamma"));
}

}  // namespace driveid_ext
