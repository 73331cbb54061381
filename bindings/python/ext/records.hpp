// SPDX-License-Identifier: Apache-2.0
// numpy columns seen as driveid_record, without a copy.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <complex>
#include <deque>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include <driveid/diagnose.h>

namespace driveid_ext {

namespace nb = nanobind;

using Stamps = nb::ndarray<const int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Values = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

// What Python hands over for one record. Keeps the arrays alive while the C call runs.
struct Record {
    std::string name;
    std::optional<std::string> hash, hold;
    Stamps t_ns;
    std::vector<std::pair<std::string, Values>> columns;
};

// The C view of several records. Not copyable: the views point into it.
class RecordViews {
public:
    explicit RecordViews(const std::vector<Record> &records) {
        for (const Record &r : records) {
            std::vector<driveid_column> &columns = columns_.emplace_back();
            for (const auto &[name, values] : r.columns) {
                if (values.shape(0) != r.t_ns.shape(0))
                    throw nb::value_error(("record " + r.name + ": column " + name + " has not as many rows as t_ns").c_str());
                columns.push_back({name.c_str(), values.data()});
            }
            views_.push_back({r.name.c_str(), r.hash ? r.hash->c_str() : nullptr, r.hold ? r.hold->c_str() : nullptr,
                              r.t_ns.shape(0), columns.size(), r.t_ns.data(), columns.data()});
        }
    }
    RecordViews(const RecordViews &) = delete;
    RecordViews &operator=(const RecordViews &) = delete;
    const driveid_record *data() const { return views_.data(); }
    size_t size() const { return views_.size(); }

private:
    std::deque<std::vector<driveid_column>> columns_;
    std::vector<driveid_record> views_;
};

// A numpy array that owns the values.
template <typename T>
nb::object array(std::vector<T> &&values, std::vector<size_t> shape) {
    auto *kept = new std::vector<T>(std::move(values));
    nb::capsule owner(kept, [](void *p) noexcept { delete static_cast<std::vector<T> *>(p); });
    return nb::cast(nb::ndarray<nb::numpy, T>(kept->data(), shape.size(), shape.data(), owner));
}

using Array = std::vector<double>;

// A status of the library as an exception.
inline void must(const char *what, driveid_status status) {
    if (status != DRIVEID_OK) throw nb::value_error((std::string(what) + ": " + driveid_status_text(status)).c_str());
}

inline nb::object complexes(const Array &re, const Array &im) {
    std::vector<std::complex<double>> out(re.size());
    for (size_t k = 0; k < re.size(); k++) out[k] = {re[k], im[k]};
    const size_t count = out.size();
    return array(std::move(out), {count});
}

void bind_model(nb::module_ &m);
void bind_diagnose(nb::module_ &m);
void bind_online(nb::module_ &m);
void bind_lti(nb::module_ &m);
void bind_modal(nb::module_ &m);
void bind_sinusoids(nb::module_ &m);
void bind_discrete(nb::module_ &m);
void bind_shifting(nb::module_ &m);

}  // namespace driveid_ext
