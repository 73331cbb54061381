// SPDX-License-Identifier: Apache-2.0
// TOML -> Config through the table of keys.
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>

#include <tomlpp.hpp>

#include <driveid/model_file.h>

#include "config/keys.hpp"

namespace gw {

namespace {

constexpr size_t kLongestFile = 1 << 20;

// Number of edits between two words: near misses are suggested.
size_t edits(std::string_view a, std::string_view b) {
    std::vector<size_t> row(b.size() + 1);
    for (size_t j = 0; j <= b.size(); ++j) row[j] = j;
    for (size_t i = 1; i <= a.size(); ++i) {
        size_t corner = row[0];
        row[0] = i;
        for (size_t j = 1; j <= b.size(); ++j) {
            const size_t up = row[j];
            row[j] = std::min({up + 1, row[j - 1] + 1, corner + (a[i - 1] != b[j - 1])});
            corner = up;
        }
    }
    return row[b.size()];
}

std::string nearest(std::string_view word, const std::vector<std::string_view>& words) {
    std::string_view best;
    size_t least = std::max<size_t>(2, word.size() / 2) + 1;
    for (auto w : words)
        if (size_t n = edits(word, w); n < least) least = n, best = w;
    return std::string(best);
}

std::string show(double v) {
    char text[40];
    snprintf(text, sizeof text, "%.10g", v);
    return text;
}

class Reader {
public:
    Reader(ConfigResult& result) : result_(result) {}

    void error(const toml::source_region& at, const std::string& key, const std::string& text) { error(int(at.begin.line), key, text); }
    void error(int line, const std::string& key, const std::string& text) {
        result_.errors.push_back(result_.config.file + ":" + std::to_string(line) + ": " + key + ": " + text);
    }

    // Fills target from table and refuses other keys; subtables are names that the caller handles.
    template <class S>
    void read(const toml::table& table, const std::string& where, std::span<const Key<S>> keys, S& target,
              std::initializer_list<std::string_view> subtables = {}, const std::string& kind = "") {
        values(table, where, keys, target, kind);
        unknown(table, where, keys, subtables);
    }

    template <class S>
    void values(const toml::table& table, const std::string& where, std::span<const Key<S>> keys, S& target, const std::string& kind = "") {
        for (const Key<S>& key : keys) {
            if (const toml::node* node = table.get(key.name)) {
                check_kind(key, kind, *node, where);
                set(key, *node, where, target);
            } else if (key.fallback) {
                set_text(key, target);
            } else {
                set_empty(key, target);
                error(table.source(), where + "." + key.name, std::string("is missing; add it: ") + key.help);
            }
        }
    }

    template <class S>
    void unknown(const toml::table& table, const std::string& where, std::span<const Key<S>> keys,
                 std::initializer_list<std::string_view> more) {
        std::vector<std::string_view> words(more);
        for (const auto& k : keys) words.push_back(k.name);
        unknown(table, where, words);
    }
    void unknown(const toml::table& table, const std::string& where, const std::vector<std::string_view>& words) {
        for (auto&& [name, node] : table) {
            if (std::find(words.begin(), words.end(), name.str()) != words.end()) continue;
            const std::string near = nearest(name.str(), words);
            error(name.source(), where.empty() ? std::string(name.str()) : where + "." + std::string(name.str()),
                  near.empty() ? "unknown key; remove it (driveidd --manual lists the keys)" : "unknown key; did you mean \"" + near + "\"?");
        }
    }

private:
    template <class S>
    void check_kind(const Key<S>& key, const std::string& kind, const toml::node& node, const std::string& where) {
        if (!*key.only_kind || kind.empty()) return;
        std::istringstream kinds(key.only_kind);
        for (std::string k; std::getline(kinds, k, '|');)
            if (k == kind) return;
        error(node.source(), where + "." + key.name, "does not belong to kind \"" + kind + "\" (only to " + key.only_kind + "); remove it");
    }

    template <class S>
    void set_text(const Key<S>& key, S& target) {
        std::visit([&](auto member) {
            using T = std::remove_reference_t<decltype(target.*member)>;
            if constexpr (std::is_same_v<T, bool>) target.*member = std::string_view(key.fallback) == "true";
            else if constexpr (std::is_same_v<T, int64_t>) target.*member = strtoll(key.fallback, nullptr, 10);
            else if constexpr (std::is_same_v<T, double>) target.*member = strtod(key.fallback, nullptr);
            else target.*member = key.fallback;
        }, key.member);
    }
    template <class S>
    void set_empty(const Key<S>& key, S& target) {
        std::visit([&](auto member) { target.*member = {}; }, key.member);
    }

    template <class S>
    void set(const Key<S>& key, const toml::node& node, const std::string& where, S& target) {
        const std::string path = where.empty() ? key.name : where + "." + key.name;
        set_empty(key, target);
        std::visit([&](auto member) {
            using T = std::remove_reference_t<decltype(target.*member)>;
            if constexpr (std::is_same_v<T, bool>) {
                if (auto v = node.value_exact<bool>()) target.*member = *v;
                else error(node.source(), path, "must be true or false");
            } else if constexpr (std::is_same_v<T, int64_t>) {
                auto v = node.value_exact<int64_t>();
                if (!v) return error(node.source(), path, "must be a whole number " + range(key));
                if (double(*v) < key.lo || double(*v) > key.hi) error(node.source(), path, "is " + std::to_string(*v) + "; must be " + range(key));
                else target.*member = *v;
            } else if constexpr (std::is_same_v<T, double>) {
                auto v = node.value<double>();
                if (!v || !node.is_number()) return error(node.source(), path, "must be a number " + range(key));
                if (std::isnan(*v) || *v < key.lo || *v > key.hi) error(node.source(), path, "is " + show(*v) + "; must be " + range(key));
                else target.*member = *v;
            } else {
                auto v = node.value_exact<std::string>();
                if (!v) return error(node.source(), path, "must be a text in quotes");
                check_text(key, *v, node, path);
                target.*member = *v;
            }
        }, key.member);
    }

    template <class S>
    void check_text(const Key<S>& key, const std::string& v, const toml::node& node, const std::string& path) {
        if (v.size() > 4000) return error(node.source(), path, "is longer than 4000 characters; shorten it");
        for (char c : v)
            if (uint8_t(c) < 0x20) return error(node.source(), path, "holds a control character; remove it");
        if (!*key.choices) return;
        std::vector<std::string_view> words;
        std::string_view rest = key.choices;
        while (true) {
            const size_t bar = rest.find('|');
            words.push_back(rest.substr(0, bar));
            if (bar == std::string_view::npos) break;
            rest.remove_prefix(bar + 1);
        }
        if (std::find(words.begin(), words.end(), v) != words.end()) return;
        std::string list;
        for (auto w : words)
            if (!w.empty()) list += (list.empty() ? "" : ", ") + std::string(w);
        const std::string near = nearest(v, words);
        error(node.source(), path, "is \"" + v + "\"; " + (near.empty() ? "must be one of " : "did you mean \"" + near + "\"? It must be one of ") + list);
    }

    template <class S>
    static std::string range(const Key<S>& key) {
        const std::string unit = *key.unit ? std::string(" ") + key.unit : "";
        if (key.hi == kAny && key.lo == -kAny) return "of any size";
        if (key.hi == kAny) return "of at least " + show(key.lo) + unit;
        return "from " + show(key.lo) + " to " + show(key.hi) + unit;
    }

    ConfigResult& result_;
};

const toml::table* section(Reader& reader, const toml::table& root, const char* name) {
    const toml::node* node = root.get(name);
    if (!node) return nullptr;
    if (const toml::table* t = node->as_table()) return t;
    reader.error(node->source(), name, std::string("must be a table; write [") + name + "]");
    return nullptr;
}

template <class F>
void each(Reader& reader, const toml::table& root, const char* name, const std::string& shown, F action) {
    const toml::node* node = root.get(name);
    if (!node) return;
    const toml::array* list = node->as_array();
    if (!list || !list->is_homogeneous(toml::node_type::table)) {
        reader.error(node->source(), shown, "must be a list of tables; write [[" + shown + "]]");
        return;
    }
    if (list->size() > 256) return reader.error(node->source(), shown, "more than 256 entries; split the configuration");
    size_t index = 0;
    for (auto&& item : *list) action(*item.as_table(), index++);
}

// toml++ 3.3 takes for granted that a table header begins with a key ("[.a]" and "[" at the end of a line are undefined there).
// No value of this configuration is an array of arrays, so each line that begins with a bracket is a header. 0: all is well.
int bad_header_line(std::string_view text) {
    int number = 0;
    while (!text.empty()) {
        ++number;
        const size_t end = std::min(text.find('\n'), text.size());
        std::string_view line = text.substr(0, end);
        text.remove_prefix(std::min(end + 1, text.size()));
        const auto skip = [&](std::string_view set, size_t most) {
            for (size_t n = 0; n < most && !line.empty() && set.find(line[0]) != std::string_view::npos; ++n) line.remove_prefix(1);
        };
        skip(" \t", line.size());
        if (line.empty() || line[0] != '[') continue;
        line.remove_prefix(1);
        skip(" \t", line.size());
        skip("[", 1);
        skip(" \t", line.size());
        const bool key = !line.empty() && (isalnum(uint8_t(line[0])) || std::string_view("_-\"']").find(line[0]) != std::string_view::npos);
        if (!key) return number;
    }
    return 0;
}

std::string text_of(const toml::table& table, const char* key) {
    return table[key].value<std::string>().value_or("");
}

void read_mux(Reader& reader, const toml::table& t, const std::string& where, FieldConfig& field) {
    field.mux_start_bit = field.mux_length = field.mux_value = 0;
    const toml::node* node = t.get("mux");
    if (!node) return;
    if (const toml::table* mux = node->as_table()) reader.read<FieldConfig>(*mux, where + ".mux", mux_keys(), field);
    else reader.error(node->source(), where + ".mux", "must be a table { start_bit, length, value }");
}

template <class S>
std::vector<std::string_view> words_of(std::span<const Key<S>> keys) {
    std::vector<std::string_view> words;
    for (const auto& k : keys) words.push_back(k.name);
    return words;
}

// A signal is a field with a few keys more: both tables of keys are read from one TOML table.
void read_signal(Reader& reader, const toml::table& t, const std::string& where, SignalConfig& signal) {
    signal.place.line = int(t.source().begin.line);
    reader.values<SignalConfig>(t, where, signal_keys(), signal);
    reader.values<FieldConfig>(t, where, field_keys(), signal);
    read_mux(reader, t, where, signal);
    auto words = words_of(signal_keys()), more = words_of(field_keys());
    words.insert(words.end(), more.begin(), more.end());
    words.push_back("mux");
    reader.unknown(t, where, words);
}

void read_given(Reader& reader, const toml::table& t, const std::string& where, DriveConfig& drive) {
    const toml::node* node = t.get("given");
    if (!node) return;
    const toml::table* given = node->as_table();
    if (!given) return reader.error(node->source(), where + ".given", "must be a table { K_t_Nm_A = 0.05 }");
    for (auto&& [name, value] : *given) {
        const auto v = value.value<double>();
        if (!v || !value.is_number() || !std::isfinite(*v)) reader.error(value.source(), where + ".given." + std::string(name.str()), "must be a finite number");
        else drive.given.emplace_back(name.str(), *v);
    }
}

void read_effects(Reader& reader, const toml::table& t, const std::string& where, DriveConfig& drive) {
    const toml::node* node = t.get("effects");
    if (!node) return;
    const toml::array* list = node->as_array();
    if (!list || (!list->empty() && !list->is_homogeneous(toml::node_type::string)))
        return reader.error(node->source(), where + ".effects", "must be a list of names such as [\"coulomb\"]");
    for (auto&& item : *list) drive.effects.push_back(item.value<std::string>().value());
}

void read_drive(Reader& reader, const toml::table& t, size_t index, DriveConfig& drive) {
    const std::string name = text_of(t, "name");
    const std::string where = "drive " + (name.empty() ? std::to_string(index + 1) : "\"" + name + "\"");
    drive.place.line = int(t.source().begin.line);
    reader.read<DriveConfig>(t, where, drive_keys(), drive, {"given", "effects", "signal", "counter"});
    read_given(reader, t, where, drive);
    read_effects(reader, t, where, drive);
    each(reader, t, "signal", "drive.signal", [&](const toml::table& s, size_t k) {
        const std::string signal = text_of(s, "name");
        drive.signals.emplace_back();
        read_signal(reader, s, where + ".signal " + (signal.empty() ? std::to_string(k + 1) : "\"" + signal + "\""), drive.signals.back());
    });
    if (const toml::table* counter = section(reader, t, "counter")) {
        drive.has_counter = true;
        drive.counter.place.line = int(counter->source().begin.line);
        reader.read<FieldConfig>(*counter, where + ".counter", field_keys(), drive.counter, {"mux"});
        read_mux(reader, *counter, where + ".counter", drive.counter);
    }
}

template <class S>
void read_section(Reader& reader, const toml::table& root, const char* name, std::span<const Key<S>> keys, S& target) {
    static const toml::table empty;
    const toml::table* t = section(reader, root, name);
    if (t) target.place.line = int(t->source().begin.line);
    reader.read<S>(t ? *t : empty, name, keys, target);
}

void read_root(Reader& reader, const toml::table& root, Config& config) {
    reader.read<Config>(root, "", top_keys(), config, {"control", "record", "state", "security", "system", "source", "drive", "sink"});
    read_section(reader, root, "control", control_keys(), config.control);
    read_section(reader, root, "record", record_keys(), config.record);
    read_section(reader, root, "state", state_keys(), config.state);
    read_section(reader, root, "security", security_keys(), config.security);
    read_section(reader, root, "system", system_keys(), config.system);
    each(reader, root, "source", "source", [&](const toml::table& t, size_t k) {
        const std::string name = text_of(t, "name");
        config.sources.emplace_back();
        config.sources.back().place.line = int(t.source().begin.line);
        reader.read<SourceConfig>(t, "source " + (name.empty() ? std::to_string(k + 1) : "\"" + name + "\""), source_keys(), config.sources.back(), {}, text_of(t, "kind"));
    });
    each(reader, root, "drive", "drive", [&](const toml::table& t, size_t k) {
        config.drives.emplace_back();
        read_drive(reader, t, k, config.drives.back());
    });
    each(reader, root, "sink", "sink", [&](const toml::table& t, size_t k) {
        const std::string name = text_of(t, "name");
        config.sinks.emplace_back();
        config.sinks.back().place.line = int(t.source().begin.line);
        reader.read<SinkConfig>(t, "sink " + (name.empty() ? std::to_string(k + 1) : "\"" + name + "\""), sink_keys(), config.sinks.back(), {}, text_of(t, "kind"));
    });
}

}  // namespace

ConfigResult config_read_text(const std::string& text, const std::string& path) {
    ConfigResult result;
    result.config.file = path;
    result.config.folder = std::filesystem::path(path).parent_path().string();
    result.config.text = text;
    Reader reader(result);
    if (text.size() > kLongestFile) {
        reader.error(1, "file", "is longer than 1 MiB; this is no configuration of driveidd");
        return result;
    }
    if (const int line = bad_header_line(text); line > 0) {
        reader.error(line, "TOML", "a table header begins with its name; write [name] or [[name]]");
        return result;
    }
    try {
        read_root(reader, toml::parse(text), result.config);
    } catch (const toml::parse_error& e) {
        reader.error(int(e.source().begin.line), "TOML", std::string(e.description()) + " (column " + std::to_string(e.source().begin.column) + "); mend the line");
    }
    if (result.errors.empty()) config_check(result);
    return result;
}

ConfigResult config_read_file(const std::string& path) {
    std::error_code ec;
    if (std::filesystem::is_directory(path, ec)) {
        ConfigResult result;
        result.errors.push_back(path + ": is a folder; name a TOML file");
        return result;
    }
    std::ifstream file(path, std::ios::binary);
    if (!file) {
        ConfigResult result;
        result.errors.push_back(path + ": cannot be read; check its name and permissions");
        return result;
    }
    std::string text(kLongestFile + 1, '\0');
    file.read(text.data(), std::streamsize(text.size()));
    text.resize(size_t(file.gcount()));
    return config_read_text(text, path);
}

std::string config_path(const Config& config, const std::string& path) {
    if (path.empty() || path[0] == '/') return path;
    return (std::filesystem::path(config.folder) / path).string();
}

}  // namespace gw
