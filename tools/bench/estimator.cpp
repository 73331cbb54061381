// SPDX-License-Identifier: Apache-2.0
// Nanoseconds per sample of the on-line estimator: next to the multiply-adds that its realisation must do and to a recursive least squares of as many
// parameters in Eigen; many drives in one call; the model watch. Prints markdown; tools/bench/estimator.py makes docs/benchmark-estimator.md with it.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <random>
#include <vector>

#include <Eigen/Dense>

#include <driveid/fleet.h>
#include <driveid/watch.h>

namespace {

// Of this thread: what others run on the machine costs it caches, not time.
double processor_ns() {
    timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return 1e9 * double(t.tv_sec) + double(t.tv_nsec);
}

constexpr int samples = 30000, settle = 120000; // initial conditions have died away in all prefilters after 80 s

driveid_regression equation(int n) { // y^(n) + sum a_i y^(i) = b u: n + 1 parameters
    driveid_regression r{};
    r.equations = 1, r.channels = 2, r.params = uint8_t(n + 1), r.terms = uint8_t(n + 2);
    r.hold[1] = DRIVEID_HOLD_ZERO;
    r.term[0] = {0, 0, uint8_t(n), DRIVEID_TERM_KNOWN, 1};
    for (int i = 0; i < n; i++) r.term[1 + i] = {0, 0, uint8_t(i), int8_t(i), 1};
    r.term[n + 1] = {0, 1, 0, int8_t(n), -1};
    return r;
}

const double *signal(int k) {
    static const std::vector<double> x = [] {
        std::mt19937 g(1);
        std::normal_distribution<double> normal;
        std::vector<double> v(2 * samples);
        for (int i = 0; i < samples; i++) v[2 * i] = std::sin(0.011 * i) + 0.5 * std::sin(0.037 * i) + 1e-3 * normal(g), v[2 * i + 1] = std::cos(0.011 * i);
        return v;
    }();
    return &x[2 * size_t(k % samples)];
}

// The best of some rounds: the machine may be busy with other things.
template <class F> double best_ns(double calls, F f, int rounds = 5) {
    double best = 1e18;
    for (int i = 0; i < rounds; i++) {
        const double from = processor_ns();
        f();
        best = std::min(best, (processor_ns() - from) / calls);
    }
    return best;
}

// Multiply-adds with the compiler's own instructions and flags, in registers: what the arithmetic alone costs.
__attribute__((noinline)) void multiply_add(double *sum, const double *x, double by, int times) {
    double s[16];
    for (int j = 0; j < 16; j++) s[j] = sum[j];
    for (int t = 0; t < times; t++)
        for (int j = 0; j < 16; j++) s[j] = s[j] * by + x[j];
    for (int j = 0; j < 16; j++) sum[j] = s[j];
}

double multiply_add_ns() {
    double sum[16] = {1}, x[16] = {0.5};
    const double ns = best_ns(16.0 * 200000, [&] { multiply_add(sum, x, 0.999, 200000); });
    return std::isfinite(sum[3]) ? ns : 0;
}

// A sample of the economical form at 1 kHz and 200 rad/s, initial conditions gone; a multiplication alone counts as one. Rows every 2 samples; coarse rows
// every 3 of them in the first stage, every 8 in the four behind prefilters.
double multiply_adds(int n) {
    const double sections = n + 2, low = n > 1 ? n : 1, pairs = (n + 2) * (n + 3) / 2.0, params = n + 1;
    const double bank = 2 * sections * (sections + 1) / 2 + 2 * sections + 2;
    double columns = 2;
    for (int d = 0; d <= n; d++) columns += 2 * d + 2;
    const double row = 4 * 2 * (low * (low + 1) / 2 + 3 * low + 5) + 5 * columns + 5 * pairs * 2 + params + params * params;
    return bank + row / 2 + pairs * 16 * 3 * (1 / 6.0 + 4 / 16.0);
}

struct Cost { double first_ns, ns; }; // from the start on; once the initial conditions have died away

Cost estimator_ns(int n, driveid_real type, bool solve, const char *method = "fsm") {
    std::vector<double> memory(driveid_estimator_size(method, type) / 8 + 1);
    auto *e = reinterpret_cast<driveid_estimator *>(memory.data());
    const driveid_regression r = equation(n);
    driveid_estimator_options o{};
    o.dt_s = 1e-3, o.alarm = -1, o.answer_s = solve ? 0 : 1e6, o.range[0] = 2, o.range[1] = 1;
    int k = 0;
    auto feed = [&](int count) {
        for (const int end = k + count; k < end; k++) driveid_estimator_update(e, INT64_C(1000000) * k, signal(k));
    };
    Cost c;
    c.first_ns = best_ns(samples, [&] {
        k = 0;
        if (driveid_estimator_configure(e, memory.size() * 8, method, type, &r, &o, nullptr, 0)) std::abort();
        feed(samples);
    });
    feed(settle);
    c.ns = best_ns(samples, [&] { feed(samples); });
    return c;
}

double rls_ns(int n) { // textbook: P and theta each sample; the derivatives that it would need come for free here
    const int p = n + 1;
    double sink = 0;
    const double ns = best_ns(samples, [&] {
        Eigen::MatrixXd P = Eigen::MatrixXd::Identity(p, p) * 1e3;
        Eigen::VectorXd theta = Eigen::VectorXd::Zero(p), phi(p), g(p);
        for (int k = p; k < samples; k++) {
            for (int i = 0; i < p; i++) phi[i] = signal(k - i)[0];
            g.noalias() = P * phi;
            const double gain = 1 / (0.9999 + phi.dot(g));
            theta += g * (gain * (signal(k)[1] - phi.dot(theta)));
            P.noalias() -= gain * g * g.transpose();
            P /= 0.9999;
        }
        sink += theta[0];
    });
    if (!std::isfinite(sink)) std::printf("\n");
    return ns;
}

// Every drive sees the signal from another instant on; 3,000 samples are run before, so that every prefilter is judged. Loop: single estimators.
double many_ns(driveid_real type, uint32_t drives, double dt_s, bool fleet) {
    const driveid_regression r = equation(2);
    driveid_estimator_options o{};
    o.dt_s = dt_s, o.alarm = -1;
    const size_t each = driveid_estimator_size("fsm", type) / 8 + 1;
    std::vector<double> memory(fleet ? driveid_fleet_size(type, &r, &o, drives) / 8 : each * drives);
    auto *f = reinterpret_cast<driveid_fleet *>(memory.data());
    auto single = [&](uint32_t d) { return reinterpret_cast<driveid_estimator *>(memory.data() + each * d); };
    for (uint32_t d = 0; d < (fleet ? 1 : drives); d++)
        if (fleet ? driveid_fleet_configure(f, memory.size() * 8, type, &r, &o, drives, nullptr, 0) : driveid_estimator_configure(single(d), each * 8, "fsm", type, &r, &o, nullptr, 0)) std::abort();
    std::vector<double> channel(2 * drives);
    std::vector<driveid_status> status(drives);
    int k = 0;
    const int count = std::max(400, int(200000 / drives)), warm = 3000;
    auto feed = [&](int steps) {
        for (const int end = k + steps; k < end; k++) {
            const int64_t t_ns = int64_t(1e9 * dt_s) * k;
            for (uint32_t d = 0; d < drives; d++) channel[d] = signal(k + 17 * int(d))[0], channel[drives + d] = signal(k + 17 * int(d))[1];
            if (fleet) driveid_fleet_update(f, t_ns, channel.data(), status.data());
            for (uint32_t d = 0; d < drives && !fleet; d++) {
                const double x[2] = {channel[d], channel[drives + d]};
                driveid_estimator_update(single(d), t_ns, x);
            }
        }
    };
    feed(warm);
    return best_ns(double(count) * drives, [&] { feed(count); });
}

double fleet_kB() {
    const driveid_regression r = equation(2);
    driveid_estimator_options o{};
    o.dt_s = 1e-3;
    return double(driveid_fleet_size(DRIVEID_F64, &r, &o, 1024)) / 1024 / 1000;
}

// A rigid axis as the daemon runs it: channels of the model, estimator, watch.
double axis_ns(bool watched) {
    driveid_model model;
    driveid_online online;
    driveid_model_init(&model, DRIVEID_STRUCTURE_RIGID_AXIS), driveid_model_give(&model, "K_t_Nm_A", 0.05);
    if (driveid_online_init(&online, &model, 1u << DRIVEID_SIGNAL_I_A | 1u << DRIVEID_SIGNAL_THETA_RAD, nullptr, 0)) std::abort();
    driveid_estimator_options o{};
    o.dt_s = 1e-3;
    std::vector<double> memory(driveid_estimator_size("fsm", DRIVEID_F64) / 8 + 1), eyes(driveid_watch_size() / 8 + 1);
    auto *e = reinterpret_cast<driveid_estimator *>(memory.data());
    auto *w = reinterpret_cast<driveid_watch *>(eyes.data());
    if (driveid_estimator_configure(e, memory.size() * 8, "fsm", DRIVEID_F64, &online.regression, &o, nullptr, 0) || driveid_watch_init(w, &online, 1e-3)) std::abort();
    int k = 0;
    std::mt19937 g(3);
    std::normal_distribution<double> normal;
    std::vector<double> noise(4096);
    for (double &x : noise) x = 1e-4 * normal(g);
    auto feed = [&](int steps) {
        driveid_estimate a;
        for (const int end = k + steps; k < end; k++) {
            const double t = 1e-3 * k, theta = std::sin(10 * t) + noise[size_t(k) % 4096], i_A = (-1.2e-4 * 100 * std::sin(10 * t) + 2e-4 * 10 * std::cos(10 * t)) / 0.05;
            driveid_sample s{};
            s.stamp.t_ns = INT64_C(1000000) * k, s.present = online.present, s.value[DRIVEID_SIGNAL_I_A] = i_A, s.value[DRIVEID_SIGNAL_THETA_RAD] = theta;
            double x[DRIVEID_CHANNELS_MAX];
            if (watched) driveid_watch_sample(w, &s);
            if (driveid_online_channels(&online, &s, x) == DRIVEID_OK) driveid_estimator_update(e, online.t_ns, x);
            if (!watched || k % 20) continue;
            const driveid_status status = driveid_estimator_estimate(e, &a);
            if (status == DRIVEID_OK) driveid_watch_estimate(w, &a, status);
        }
    };
    feed(settle);
    return best_ns(samples / 10, [&] { feed(samples / 10); }, 100);
}

// Every method by its name in the configuration, n = 2, 3 parameters; estimator.py adds the ratios to Python's libraries.
void every_method() {
    const double rls = rls_ns(2);
    std::printf("\n## Every on-line method\n\nn = 2, 3 parameters, solves included, after two minutes of motion (adm has switched itself off by then); over the recursive least squares of Eigen (%.0f ns) and of Python's libraries, in one run.\n\n"
                "| method | type | ns a sample | over Eigen RLS | padasip over it | filterpy over it |\n|---|---|---|---|---|---|\n", rls);
    const char *const type_name[] = {"f64", "f32", "q31"};
    for (const char *method : {"fsm", "window", "discrete", "rls", "kalman", "adm"})
        for (driveid_real type : {DRIVEID_F64, DRIVEID_F32, DRIVEID_Q31}) {
            if (!driveid_estimator_size(method, type)) continue;
            const double ns = estimator_ns(2, type, true, method).ns;
            std::printf("| %s | %s | %.0f | %.1f | @padasip %.0f | @filterpy %.0f |\n", method, type_name[type], ns, ns / rls, ns, ns);
            std::fflush(stdout);
        }
}

} // namespace

int main() {
    const double one = multiply_add_ns();
    std::printf("Compiler %s, flags %s. A multiply-add in registers costs %.3f ns with them (two doubles an instruction, multiplication and addition apart).\n\n", __VERSION__, DRIVEID_BENCH_FLAGS, one);
    std::printf("## One drive\n\n| n | parameters | type | multiply-adds | update, ns | over their time | with solve, ns | the same, first 30 s | Eigen RLS, ns | update / RLS | with solve / RLS | drives a core at 1 kHz |\n"
                "|---|---|---|---|---|---|---|---|---|---|---|---|\n");
    for (int n : {1, 2, 4, 6}) {
        const double rls = rls_ns(n), adds = multiply_adds(n);
        for (driveid_real type : {DRIVEID_F64, DRIVEID_F32}) {
            const Cost plain = estimator_ns(n, type, false), solved = estimator_ns(n, type, true);
            std::printf("| %d | %d | %s | %.0f | %.0f | %.1f | %.0f | %.0f | %.0f | %.1f | %.1f | %.0f |\n", n, n + 1, type == DRIVEID_F64 ? "f64" : "f32", adds, plain.ns, plain.ns / (adds * one),
                        solved.ns, solved.first_ns, rls, plain.ns / rls, solved.ns / rls, 1e6 / solved.ns);
            std::fflush(stdout);
        }
    }
    every_method();
    std::printf("\n## Many drives\n\nn = 2, 3 parameters, solves included, initial conditions still in the sums (the dearer part of a drive's life); ns a sample and drive.\n\n"
                "| drives | type | sample rate | one call (fleet.h) | a loop over estimators | loop / one call | drives a core |\n|---|---|---|---|---|---|---|\n");
    for (double dt_s : {1e-3, 2.5e-4})
        for (driveid_real type : {DRIVEID_F64, DRIVEID_F32})
            for (uint32_t drives : {1u, 16u, 1024u}) {
                const double together = many_ns(type, drives, dt_s, true), loop = many_ns(type, drives, dt_s, false);
                std::printf("| %u | %s | %.0f kHz | %.0f | %.0f | %.2f | %.0f |\n", drives, type == DRIVEID_F64 ? "f64" : "f32", 1e-3 / dt_s, together, loop, loop / together, 1e9 * dt_s / together);
                std::fflush(stdout);
            }
    std::printf("\nWhy one call gains little: of the %.0f multiply-adds a sample at 1 kHz only the %.0f of the filter bank run at every sample and are stepped for eight drives side by side. The rest (rows, prefilters,\n"
                "sums, at their slower rates) is vectorised already within a drive, over lags and stages, so it takes as long in either form; what the call saves is what a bank costs beyond a loop's, and its\n"
                "sorting by drive costs as much for a few drives. What it gives is storage cut after what a drive uses (%.0f kB against %.0f), and the goal: 1024 drives at 1 kHz on one core.\n",
                multiply_adds(2), 2 * 4.0 * 5 / 2 + 2 * 4 + 2, fleet_kB(), double(driveid_estimator_size("fsm", DRIVEID_F64)) / 1000);
    const double alone = axis_ns(false), watched = axis_ns(true);
    std::printf("\n## The model watch\n\nA rigid axis of two parameters at 1 kHz, from the sample to the answer: %.0f ns; with the model watch (watch.h) beside it: %.0f ns, %.0f drives a core.\n", alone, watched, 1e6 / watched);
}
