// SPDX-License-Identifier: Apache-2.0
#include "system/state.hpp"

#include <cerrno>
#include <cmath>
#include <cstring>
#include <fcntl.h>
#include <fstream>
#include <sstream>
#include <unistd.h>

#include <nlohmann/json.hpp>

#include <driveid/version.h>

#include "base/clock.hpp"
#include "base/crc32.hpp"
#include "base/json_out.hpp"
#include "base/loop.hpp"

namespace gw {

namespace {

constexpr char kMagic[] = "driveid-state 1 ";
constexpr size_t kLongest = 16u << 20;

std::string text_of(const std::vector<std::unique_ptr<Drive>>& drives) {
    const int64_t now = monotonic_ns();
    JsonOut o;
    o.open('{').field("driveid", DRIVEID_VERSION).field("saved_wall_ns", clock_ns(CLOCK_REALTIME)).key("drives").open('[');
    for (auto& d : drives) {
        o.open('{').field("name", d->config().name).field("structure", d->structure()).field("method", d->config().method).field("type", d->config().type);
        o.key("parameters").open('[');
        for (const auto& p : d->parameters()) {
            if (!p.known) continue;
            o.open('{').field("name", p.name).field("value", p.value).field("lo", p.lo).field("hi", p.hi).field("age_s", d->age_s(p, now)).close('}');
        }
        const driveid_estimate& e = d->estimate();
        o.close(']').key("names").open('[');
        for (const auto& p : d->parameters()) o.string(p.name);
        o.close(']').key("theta").open('[');
        for (uint32_t k = 0; k < e.params; ++k) o.number(e.theta[k]);
        o.close(']').key("covariance").open('[');
        for (uint32_t k = 0; k < e.params * e.params; ++k) o.number(e.cov[k]);
        o.close(']').close('}');
    }
    const std::string& json = o.close(']').close('}').text();
    char head[64];
    snprintf(head, sizeof head, "%s%08x %zu\n", kMagic, crc32(json.data(), json.size()), json.size());
    return head + json;
}

bool write_all(int fd, const std::string& text) {
    for (size_t done = 0; done < text.size();) {
        const ssize_t n = write(fd, text.data() + done, text.size() - done);
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0) return false;
        done += size_t(n);
    }
    return true;
}

double finite(const nlohmann::json& o, const char* key, bool& ok) {
    const auto it = o.find(key);
    if (it == o.end() || !it->is_number()) return ok = false, 0.0;
    const double v = it->get<double>();
    if (!std::isfinite(v)) ok = false;
    return v;
}

bool same(const nlohmann::json& o, const char* key, const std::string& value) {
    const auto it = o.find(key);
    return it != o.end() && it->is_string() && it->get<std::string>() == value;
}

void apply_parameter(const nlohmann::json& p, Drive& drive, double since_s, int64_t now_ns, int& restored) {
    if (!p.is_object()) return;
    bool ok = true;
    const double value = finite(p, "value", ok), lo = finite(p, "lo", ok), hi = finite(p, "hi", ok), age = finite(p, "age_s", ok);
    if (!ok || lo > hi) return;
    for (auto& mine : drive.parameters()) {
        if (mine.known || !same(p, "name", mine.name)) continue;
        mine.known = true, mine.trusted = false;
        mine.value = value, mine.lo = lo, mine.hi = hi;
        mine.t_ns = now_ns;
        mine.restored_age_s = std::max(0.0, age) + since_s;
        ++restored;
    }
}

// Numbers of an array, all finite and no more than there is room for; how many, -1 where it is not such an array.
int numbers(const nlohmann::json& o, const char* key, double* out, size_t room) {
    const auto it = o.find(key);
    if (it == o.end() || !it->is_array() || it->size() > room) return -1;
    int n = 0;
    for (const auto& v : *it) {
        if (!v.is_number() || !std::isfinite(v.get<double>())) return -1;
        out[n++] = v.get<double>();
    }
    return n;
}

// The parameters that the drive identifies now, in their order: else the numbers belong to another model.
bool same_names(const nlohmann::json& entry, const Drive& drive) {
    const auto it = entry.find("names");
    if (it == entry.end() || !it->is_array() || it->size() != drive.parameters().size()) return false;
    for (size_t k = 0; k < it->size(); ++k)
        if (!(*it)[k].is_string() || (*it)[k].get<std::string>() != drive.parameters()[k].name) return false;
    return true;
}

void apply_estimate(const nlohmann::json& entry, Drive& drive) {
    if (!same_names(entry, drive)) return;
    double theta[DRIVEID_THETA_MAX], covariance[DRIVEID_THETA_MAX * DRIVEID_THETA_MAX];
    const int n = numbers(entry, "theta", theta, std::size(theta));
    if (n > 0 && numbers(entry, "covariance", covariance, std::size(covariance)) == n * n) drive.remember(theta, covariance, uint32_t(n));
}

}  // namespace

std::string state_save(const std::string& folder, const std::vector<std::unique_ptr<Drive>>& drives) {
    const std::string now = folder + "/state", old = now + ".old", fresh = now + ".tmp";
    const auto failed = [&](const std::string& path) { return path + ": " + strerror(errno); };
    Fd fd(open(fresh.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0640));
    if (!fd) return failed(fresh);
    if (!write_all(fd.get(), text_of(drives)) || fsync(fd.get()) < 0) return failed(fresh);
    fd.reset();
    // A crash between the two renames leaves state.old, which is read then.
    if (rename(now.c_str(), old.c_str()) < 0 && errno != ENOENT) return failed(now);
    if (rename(fresh.c_str(), now.c_str()) < 0) return failed(fresh);
    Fd directory(open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (!directory || fsync(directory.get()) < 0) return failed(folder);
    return "";
}

bool state_open(std::string_view file, std::string_view& json) {
    const size_t magic = sizeof kMagic - 1;
    if (!file.starts_with(kMagic)) return false;
    const size_t end = file.find('\n');
    if (end == std::string_view::npos || end > 64) return false;
    const std::string head(file.substr(magic, end - magic));
    unsigned crc = 0;
    size_t length = 0;
    if (sscanf(head.c_str(), "%8x %zu", &crc, &length) != 2) return false;
    json = file.substr(end + 1);
    return json.size() == length && crc32(json.data(), json.size()) == crc;
}

bool state_apply(std::string_view text, std::vector<std::unique_ptr<Drive>>& drives, int64_t now_wall_ns, int64_t now_ns, int& restored) {
    const auto state = nlohmann::json::parse(text, nullptr, false);
    if (!state.is_object()) return false;
    const auto list = state.find("drives"), saved = state.find("saved_wall_ns");
    if (list == state.end() || !list->is_array() || saved == state.end() || !saved->is_number_integer()) return false;
    const double since_s = std::max(0.0, double(now_wall_ns - saved->get<int64_t>()) * 1e-9);
    for (const auto& entry : *list) {
        if (!entry.is_object() || !entry.contains("parameters") || !entry["parameters"].is_array()) continue;
        for (auto& d : drives) {
            if (!same(entry, "name", d->config().name) || !same(entry, "structure", d->structure()) || !same(entry, "method", d->config().method) || !same(entry, "type", d->config().type)) continue;
            for (const auto& p : entry["parameters"]) apply_parameter(p, *d, since_s, now_ns, restored);
            apply_estimate(entry, *d);
        }
    }
    return true;
}

std::string state_restore(const std::string& folder, std::vector<std::unique_ptr<Drive>>& drives) {
    for (const char* name : {"/state", "/state.old"}) {
        std::ifstream file(folder + name, std::ios::binary);
        if (!file) continue;
        std::stringstream all;
        all << file.rdbuf();
        const std::string text = all.str();
        std::string_view json;
        int restored = 0;
        if (text.size() > kLongest || !state_open(text, json) || !state_apply(json, drives, clock_ns(CLOCK_REALTIME), monotonic_ns(), restored)) continue;
        return folder + name + ": " + std::to_string(restored) + " parameters restored";
    }
    return "";
}

}  // namespace gw
