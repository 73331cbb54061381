// SPDX-License-Identifier: Apache-2.0
// Truth for the tests of the modal method: closed-form responses as sums of complex exponentials (residues), no integration and
// no code of the library.
#pragma once

#include <cmath>
#include <complex>
#include <vector>

namespace truth {

using C = std::complex<double>;

struct Term {
    C coefficient, exponent;
};
using Signal = std::vector<Term>;

inline double value(const Signal &s, double t) {
    C sum = 0;
    for (const Term &term : s) sum += term.coefficient * std::exp(term.exponent * t);
    return sum.real();
}

// H(s) = b(s) / prod (s - pole), b given lowest power first.
struct System {
    std::vector<double> b;
    std::vector<C> pole;

    C numerator(C s) const {
        C sum = 0;
        for (std::size_t k = b.size(); k-- > 0;) sum = sum * s + b[k];
        return sum;
    }
    C denominator(C s, std::size_t skip = SIZE_MAX) const {
        C product = 1;
        for (std::size_t k = 0; k < pole.size(); k++)
            if (k != skip) product *= s - pole[k];
        return product;
    }
    C response(C s) const { return numerator(s) / denominator(s); }

    // Output from rest to an input that is a sum of exponentials switched on at t = 0.
    Signal forced(const Signal &u) const {
        Signal y;
        for (const Term &in : u) {
            y.push_back({in.coefficient * response(in.exponent), in.exponent});
            for (std::size_t k = 0; k < pole.size(); k++)
                y.push_back({in.coefficient * numerator(pole[k]) / denominator(pole[k], k) / (pole[k] - in.exponent), pole[k]});
        }
        return y;
    }

    // Free response from y(0), Dy(0), ...: Lagrange form of the Vandermonde inverse.
    Signal free(const std::vector<double> &initial) const {
        Signal y;
        for (std::size_t k = 0; k < pole.size(); k++) {
            std::vector<C> polynomial{1};
            for (std::size_t j = 0; j < pole.size(); j++) {
                if (j == k) continue;
                polynomial.push_back(0);
                for (std::size_t i = polynomial.size(); i-- > 1;) polynomial[i] = polynomial[i - 1] - pole[j] * polynomial[i];
                polynomial[0] *= -pole[j];
            }
            C sum = 0;
            for (std::size_t i = 0; i < polynomial.size(); i++) sum += polynomial[i] * initial[i];
            y.push_back({sum / denominator(pole[k], k), pole[k]});
        }
        return y;
    }

    // From rest to steps of size v_k at times t_k.
    double steps(const std::vector<std::pair<double, double>> &step, double t) const {
        const Signal unit = forced({{1, 0}});
        double sum = 0;
        for (const auto &[when, size] : step)
            if (t >= when) sum += size * value(unit, t - when);
        return sum;
    }
};

inline System third_order(double zero_gain = 13) { return {{52, zero_gain}, {C(-2, 0), C(-1, 5), C(-1, -5)}}; }
inline System fourth_order() { return {{400, 400}, {C(-1, 1.5), C(-1, -1.5), C(-2, 10), C(-2, -10)}}; }

} // namespace truth
