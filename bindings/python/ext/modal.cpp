// SPDX-License-Identifier: Apache-2.0
// modal.h: modal functions and Prony.
#include "records.hpp"

#include <driveid/modal.h>

namespace driveid_ext {
namespace {

using Matrix = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Shifts = std::vector<int32_t>;

void asked(bool holds, const char *what) {
    if (!holds) throw nb::value_error(what);
}

driveid_quadrature quadrature_of(const std::string &name) {
    if (name == "trapezoid") return DRIVEID_QUADRATURE_TRAPEZOID;
    if (name == "simpson") return DRIVEID_QUADRATURE_SIMPSON;
    if (name == "boole") return DRIVEID_QUADRATURE_BOOLE;
    throw nb::value_error(("quadrature is \"trapezoid\", \"simpson\" or \"boole\", not \"" + name + "\"").c_str());
}

driveid_basis basis_of(const std::string &name) {
    if (name == "samples") return DRIVEID_BASIS_SAMPLES;
    if (name == "fourier") return DRIVEID_BASIS_FOURIER;
    if (name == "walsh") return DRIVEID_BASIS_WALSH;
    throw nb::value_error(("basis is \"samples\", \"fourier\" or \"walsh\", not \"" + name + "\"").c_str());
}

// The task with the arrays it points to.
struct Task {
    driveid_modal_task c{};
    Shifts shift;
    std::vector<size_t> first, last;
    Task(const Values &y, double T_s, const Shifts &shifts, const std::optional<Matrix> &mode, const std::vector<std::pair<size_t, size_t>> &windows, const std::string &basis, size_t functions,
         const std::string &quadrature, size_t stride, int32_t instrument)
        : shift(shifts) {
        asked(!mode || mode->shape(0) == y.shape(0), "mode has one row a sample of y");
        for (const auto &[from, to] : windows) first.push_back(from), last.push_back(to);
        c.order = shift.size(), c.T_s = T_s, c.rows = y.shape(0), c.y = y.data();
        c.modes = mode ? mode->shape(1) : 0, c.mode = mode ? mode->data() : nullptr, c.shift = shift.data();
        c.windows = first.size(), c.first = first.data(), c.last = last.data();
        c.basis = basis_of(basis), c.functions = functions, c.quadrature = quadrature_of(quadrature), c.stride = stride, c.instrument = instrument;
    }
};

struct Experiments {
    std::vector<std::tuple<Matrix, Values, Values>> kept;
    std::vector<driveid_modal_experiment> c;
    Experiments(const std::vector<std::tuple<Matrix, Values, Values>> &given, size_t rows) : kept(given) {
        for (const auto &[A, out, q] : kept) {
            const size_t n = A.shape(0);
            asked(A.shape(1) == n && out.shape(0) == n && q.shape(0) == rows * n, "an experiment is (A_c [n, n], c_c [n], q): q has n values a modal function");
            c.push_back({n, A.data(), out.data(), q.data()});
        }
    }
};

void bind_parameters(nb::module_ &m) {
    m.def("modal_parameters", [](const Values &y, double T_s, const Shifts &shift, const std::optional<Matrix> &mode, const std::vector<std::pair<size_t, size_t>> &windows, const std::string &basis,
                                 size_t functions, const std::string &quadrature, size_t stride, int32_t instrument, size_t derivatives) {
        const Task t(y, T_s, shift, mode, windows, basis, functions, quadrature, stride, instrument);
        Array p((derivatives + 1) * t.c.order), q((derivatives + 1) * t.c.modes);
        must("modal parameters", driveid_modal_parameters(&t.c, derivatives, p.data(), q.data()));
        return std::pair(array(std::move(p), {derivatives + 1, t.c.order}), array(std::move(q), {derivatives + 1, t.c.modes}));
    });
    m.def("modal_parameters_from_a", [](const Values &a, double T_s, const Shifts &shift, size_t derivatives) {
        asked(shift.size() == a.shape(0), "as many shifts as coefficients of a");
        Array p((derivatives + 1) * shift.size());
        must("modal parameters", driveid_modal_parameters_from_a(shift.size(), a.data(), T_s, shift.data(), derivatives, p.data()));
        return array(std::move(p), {derivatives + 1, shift.size()});
    });
    m.def("modal_prefilter", [](const Matrix &A_c, const Values &c_c, double T_s, const Shifts &shift) {
        asked(A_c.shape(0) == A_c.shape(1) && c_c.shape(0) == A_c.shape(0) && shift.size() == A_c.shape(0), "A_c [n, n], c_c [n] and n shifts");
        Array l(shift.size());
        must("prefilter", driveid_modal_prefilter(l.size(), A_c.data(), c_c.data(), T_s, shift.data(), l.data()));
        const size_t count = l.size();
        return array(std::move(l), {count});
    });
    m.def("modal_a", [](const Matrix &p) {
        asked(p.shape(0) == p.shape(1) + 1, "p has one row a derivative 0 .. n and n columns");
        Array a(p.shape(1));
        must("a", driveid_modal_a(a.size(), p.data(), a.data()));
        const size_t count = a.size();
        return array(std::move(a), {count});
    });
    m.def("modal_b", [](const Values &a, size_t zeros, const std::vector<std::tuple<Matrix, Values, Values>> &experiments) {
        const Experiments e(experiments, a.shape(0) + 1);
        Array b(zeros + 1);
        must("b", driveid_modal_b(a.shape(0), zeros, a.data(), e.c.size(), e.c.data(), b.data()));
        return array(std::move(b), {zeros + 1});
    });
    m.def("modal_ab", [](double T_s, const Shifts &shift, const Matrix &p_o, const std::vector<std::tuple<Matrix, Values, Values>> &experiments) {
        const Experiments e(experiments, 1);
        const size_t n = shift.size();
        asked(p_o.shape(0) == e.c.size() && p_o.shape(1) == n, "p_o has a row an experiment and a column a shift");
        Array a(n), b(n);
        must("a and b", driveid_modal_ab(n, T_s, shift.data(), p_o.data(), e.c.size(), e.c.data(), a.data(), b.data()));
        return std::pair(array(std::move(a), {n}), array(std::move(b), {n}));
    });
}

void bind_responses(nb::module_ &m) {
    m.def("modal_free_response", [](const Values &y, double T_s, const Shifts &shift, size_t start, size_t block, size_t hop, size_t blocks, const std::string &quadrature, bool untustin) {
        const size_t n = shift.size();
        Array a(n), re(n), im(n);
        must("free response", driveid_modal_free_response(n, T_s, y.shape(0), y.data(), shift.data(), start, block, hop, blocks, quadrature_of(quadrature), untustin, a.data(), re.data(), im.data()));
        return std::pair(array(std::move(a), {n}), complexes(re, im));
    });
    m.def("modal_deflate", [](const Values &a_aug, const Values &a_c) {
        asked(a_aug.shape(0) > a_c.shape(0), "a_aug has more coefficients than a_c");
        Array a(a_aug.shape(0) - a_c.shape(0));
        must("deflate", driveid_modal_deflate(a.size(), a_c.shape(0), a_aug.data(), a_c.data(), a.data()));
        const size_t count = a.size();
        return array(std::move(a), {count});
    });
    m.def("modal_frequency_response", [](const Values &y, const Values &u, double T_s, const Shifts &shift, std::pair<size_t, size_t> window, const Values &p_o, const Values &omega) {
        asked(u.shape(0) == y.shape(0) && p_o.shape(0) == shift.size(), "u has as many samples as y, p_o as many values as there are shifts");
        const Task t(y, T_s, shift, std::nullopt, {window}, "samples", 0, "trapezoid", 1, 0);
        Array re(omega.shape(0)), im(omega.shape(0));
        must("frequency response", driveid_modal_frequency_response(&t.c, u.data(), p_o.data(), re.size(), omega.data(), re.data(), im.data()));
        return complexes(re, im);
    });
    m.def("modal_step_response", [](const Values &y, size_t hold, const Values &u_level, const Values &p_o, size_t count) {
        Array g(count);
        must("step response", driveid_modal_step_response(p_o.shape(0), y.shape(0), y.data(), hold, u_level.shape(0), u_level.data(), p_o.data(), count, g.data()));
        return array(std::move(g), {count});
    });
    m.def("modal_impulse_response", [](size_t order, const Values &g, double T_s, size_t hold, size_t period, size_t functions, size_t count) {
        Array h(count);
        must("impulse response", driveid_modal_impulse_response(order, T_s, g.shape(0), g.data(), hold, period, functions, count, h.data()));
        return array(std::move(h), {count});
    });
    m.def("modal_observer", [](const Matrix &p, size_t hold, const Values &g, size_t phase) {
        const size_t n = p.shape(1);
        asked(p.shape(0) == n && g.shape(0) >= (n + 1) * hold + 1, "p is square; g has at least (order + 1) * hold + 1 values");
        Array Q(n * (n + 1));
        must("observer", driveid_modal_observer(n, p.data(), hold, g.data(), phase, Q.data()));
        return array(std::move(Q), {n, n + 1});
    });
    m.def("modal_state_input", [](const Matrix &p, size_t hold, const Values &g) {
        const size_t n = p.shape(1);
        asked(p.shape(0) == n + 1, "p has the rows of the output and of its first derivatives up to the order");
        Array b(n);
        must("state input", driveid_modal_state_input(n, p.data(), hold, g.shape(0), g.data(), b.data()));
        return array(std::move(b), {n});
    });
    m.def("prony", [](size_t order, const Values &y, double T_s, size_t lag, size_t equations) {
        Array re(order), im(order);
        double condition = 0;
        must("prony", driveid_prony(order, T_s, y.shape(0), y.data(), lag, equations, re.data(), im.data(), &condition));
        return std::pair(complexes(re, im), condition);
    });
}

}  // namespace

void bind_modal(nb::module_ &m) {
    bind_parameters(m);
    bind_responses(m);
}

}  // namespace driveid_ext
