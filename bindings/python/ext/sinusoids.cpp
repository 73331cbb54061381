// SPDX-License-Identifier: Apache-2.0
// frequency.h and excitation.h: the frequencies in a signal, and the sinusoid to excite a resonance with.
#include "records.hpp"

#include <cmath>
#include <memory>

#include <driveid/excitation.h>
#include <driveid/frequency.h>

namespace driveid_ext {
namespace {

// (status, [(omega, lo, hi)]) at the end of the record. NaN: no sample.
std::pair<int, std::vector<std::tuple<double, double, double>>> frequencies(const Stamps &t_ns, const Values &y, uint32_t sinusoids, double omega_max_rad_s, double dt_s, const std::string &method) {
    if (t_ns.shape(0) != y.shape(0)) throw nb::value_error("the signal has not as many rows as t_ns");
    driveid_regression regression;
    must("frequency", driveid_frequency_regression(sinusoids, omega_max_rad_s, &regression));
    driveid_estimator_options o{};
    o.dt_s = dt_s, o.forgetting_s = INFINITY, o.alarm = -1;
    const size_t size = driveid_estimator_size(method.c_str(), DRIVEID_F64);
    if (size == 0) throw nb::value_error(("no method \"" + method + "\": " DRIVEID_ESTIMATOR_METHODS).c_str());
    const auto memory = std::make_unique<std::max_align_t[]>(size / sizeof(std::max_align_t) + 1);
    auto *e = reinterpret_cast<driveid_estimator *>(memory.get());
    std::string reason(512, '\0');
    if (driveid_estimator_configure(e, size, method.c_str(), DRIVEID_F64, &regression, &o, reason.data(), reason.size()) != DRIVEID_OK) throw nb::value_error(reason.c_str());
    driveid_estimate a{};
    driveid_frequency f{};
    driveid_status status;
    {
        nb::gil_scoped_release release;
        for (size_t k = 0; k < y.shape(0); k++)
            if (std::isfinite(y.data()[k])) driveid_estimator_update(e, 1 + t_ns.data()[k], &y.data()[k]);
        status = driveid_estimator_estimate(e, &a);
        if (status == DRIVEID_OK || status == DRIVEID_FROZEN) status = driveid_frequency_read(&a, &f);
    }
    std::vector<std::tuple<double, double, double>> out;
    for (uint32_t k = 0; status == DRIVEID_OK && k < f.sinusoids; k++) out.emplace_back(f.omega_rad_s[k], f.lo_rad_s[k], f.hi_rad_s[k]);
    return {status, out};
}

std::pair<double, double> bound(const driveid_excitation &e, double ratio) {
    double omega = 0, zeta = 0;
    must("excitation", driveid_excitation_bound(&e, ratio, &omega, &zeta));
    return {omega, zeta};
}

std::pair<double, double> suggest(const driveid_excitation &e) {
    double ratio = 0, omega = 0;
    nb::gil_scoped_release release;
    const driveid_status s = driveid_excitation_suggest(&e, &ratio, &omega);
    nb::gil_scoped_acquire acquire;
    must("excitation", s);
    return {ratio, omega};
}

}  // namespace

void bind_sinusoids(nb::module_ &m) {
    m.def("frequencies", &frequencies, nb::arg("t_ns"), nb::arg("y"), nb::arg("sinusoids"), nb::arg("omega_max_rad_s"), nb::arg("dt_s"), nb::arg("method"));
    nb::class_<driveid_excitation>(m, "Excitation")
        .def("__init__",
             [](driveid_excitation *self, double omega_0_rad_s, double zeta, double amplitude, double sigma, double dt_s, double span_s) {
                 new (self) driveid_excitation{omega_0_rad_s, zeta, amplitude, sigma, dt_s, span_s};
             },
             nb::kw_only(), nb::arg("omega_0_rad_s"), nb::arg("zeta"), nb::arg("amplitude"), nb::arg("sigma"), nb::arg("dt_s"), nb::arg("span_s"))
        .def("bound", &bound, nb::arg("ratio"), "Relative standard deviations of omega_0 and zeta that no unbiased estimator goes below.")
        .def("suggest", &suggest, "(ratio, relative standard deviation of omega_0 there).");
}

}  // namespace driveid_ext
