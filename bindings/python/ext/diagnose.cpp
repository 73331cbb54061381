// SPDX-License-Identifier: Apache-2.0
// diagnose.h: each call runs on a thread of its own without the GIL, while the caller's thread reports progress to
// Python and looks for KeyboardInterrupt; so no thread of the library ever touches Python.
#include "records.hpp"

#include <chrono>
#include <future>
#include <mutex>

namespace driveid_ext {
namespace {

using Call = driveid_status (*)(const driveid_task *, char **, char *, size_t);
using Answer = std::tuple<int, std::optional<std::string>, std::string>;  // status, JSON or nothing, message

struct Progress {
    std::mutex mutex;
    double done = 0;
    std::string what;
    bool news = false, cancel = false;
};

int on_progress(void *context, double done, const char *what) {
    auto *p = static_cast<Progress *>(context);
    std::lock_guard lock(p->mutex);
    p->done = done;
    p->what = what ? what : "";
    p->news = true;
    return p->cancel ? 1 : 0;
}

// Waits for the worker; calls Python between. A Python error (KeyboardInterrupt, or one of the callback's) cancels and is raised afterwards.
void wait(std::future<driveid_status> &worker, Progress &p, const nb::object &callback) {
    bool failed = false;
    nb::python_error *error = nullptr;
    for (;;) {
        bool ready;
        {
            nb::gil_scoped_release release;
            ready = worker.wait_for(std::chrono::milliseconds(40)) == std::future_status::ready;
        }
        if (ready) break;
        if (failed) continue;
        try {
            if (PyErr_CheckSignals() != 0) throw nb::python_error();
            std::unique_lock lock(p.mutex);
            const bool news = std::exchange(p.news, false);
            const double done = p.done;
            const std::string what = p.what;
            lock.unlock();
            if (news && !callback.is_none()) callback(done, what);
        } catch (nb::python_error &e) {
            failed = true;
            error = new nb::python_error(e);
            std::lock_guard lock(p.mutex);
            p.cancel = true;
        }
    }
    if (failed) {
        nb::python_error copy(*error);
        delete error;
        throw copy;
    }
}

Answer run(Call call, const std::string &model, const std::vector<Record> &training, const std::vector<Record> &held_out,
           const std::optional<std::string> &options, const nb::object &progress) {
    RecordViews train(training), held(held_out);
    Progress p;
    driveid_task task{model.c_str(), train.data(), train.size(), held.data(), held.size(),
                      options ? options->c_str() : nullptr, on_progress, &p};
    char *json = nullptr;
    std::string message(1024, '\0');
    std::future<driveid_status> worker =
        std::async(std::launch::async, [&] { return call(&task, &json, message.data(), message.size()); });
    std::exception_ptr raised;
    try {
        wait(worker, p, progress);
    } catch (...) {
        raised = std::current_exception();
    }
    const driveid_status status = worker.get();
    std::optional<std::string> text;
    if (json) {
        text = json;
        driveid_text_free(json);
    }
    if (raised) std::rethrow_exception(raised);
    return {status, text, message.c_str()};
}

template <Call call>
void bind(nb::module_ &m, const char *name, const char *doc) {
    m.def(
        name,
        [](const std::string &model, const std::vector<Record> &training, const std::vector<Record> &held_out,
           const std::optional<std::string> &options, const nb::object &progress) {
            return run(call, model, training, held_out, options, progress);
        },
        nb::arg("model_toml"), nb::arg("training"), nb::arg("held_out") = std::vector<Record>(),
        nb::arg("options_json") = nb::none(), nb::arg("progress") = nb::none(), doc);
}

nb::tuple series(const std::string &model, const Record &record) {
    const std::vector<Record> one{record};   // outlives the view: it points into it
    RecordViews view(one);
    char *json = nullptr;
    double *data = nullptr;
    std::string message(1024, '\0');
    driveid_status status;
    {
        nb::gil_scoped_release release;
        status = driveid_series(model.c_str(), view.data(), &json, &data, message.data(), message.size());
    }
    std::optional<std::string> text;
    if (json) {
        text = json;
        driveid_text_free(json);
    }
    nb::object array = nb::none();
    if (data) {
        nb::capsule owner(data, [](void *p) noexcept { driveid_series_free(static_cast<double *>(p)); });
        // Flat; the header in the JSON says how many rows a series has.
        nb::object length = nb::module_::import_("json").attr("loads")(text.value_or("{}"));
        const size_t rows = nb::cast<size_t>(length["rows"]), count = nb::len(nb::object(length["series"]));
        array = nb::cast(nb::ndarray<nb::numpy, double, nb::ndim<2>>(data, {count, rows}, owner));
    }
    return nb::make_tuple(static_cast<int>(status), text, array, message.c_str());
}

}  // namespace

void bind_diagnose(nb::module_ &m) {
    nb::class_<Record>(m, "Record", "Columns of one record as the C library sees them; arrays are not copied.")
        .def(
            "__init__",
            [](Record *self, std::string name, Stamps t_ns, std::vector<std::pair<std::string, Values>> columns,
               std::optional<std::string> hash, std::optional<std::string> hold) {
                new (self) Record{std::move(name), std::move(hash), std::move(hold), std::move(t_ns), std::move(columns)};
            },
            nb::arg("name"), nb::arg("t_ns"), nb::arg("columns"), nb::arg("hash") = nb::none(), nb::arg("hold") = nb::none());
    bind<driveid_fit>(m, "fit", "(status, JSON, message) of driveid_fit.");
    bind<driveid_compare>(m, "compare", "(status, JSON, message) of driveid_compare.");
    bind<driveid_explain>(m, "explain", "(status, JSON, message) of driveid_explain.");
    bind<driveid_improve>(m, "improve", "(status, JSON, message) of driveid_improve.");
    bind<driveid_power>(m, "power", "(status, JSON, message) of driveid_power.");
    m.def("series", &series, nb::arg("model_toml"), nb::arg("record"), "(status, JSON header, array[series, rows], message) of driveid_series.");
    m.def(
        "catalogue",
        [] {
            char *json = nullptr;
            const driveid_status status = driveid_catalogue(&json);
            std::optional<std::string> text;
            if (json) {
                text = json;
                driveid_text_free(json);
            }
            return std::make_pair(static_cast<int>(status), text);
        },
        "(status, JSON) of driveid_catalogue.");
}

}  // namespace driveid_ext
