// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <unistd.h>

#include <nlohmann/json.hpp>

#include <driveid/version.h>

#include "base/clock.hpp"
#include "control/describe.hpp"
#include "control/server.hpp"

namespace gw {

namespace {

using nlohmann::json;

constexpr int kDepthMax = 8;

bool refuse(JsonOut& out, const json& id, const char* error, std::string_view message) {
    out.clear();
    out.open('{').field("driveid", DRIVEID_FORMAT).key("id");
    id.is_number_integer() ? out.integer(id.get<int64_t>()) : out.null();
    out.field("ok", false).field("error", error).field("message", message).close('}');
    return false;
}

struct Context {
    const json& request;
    const json& id;
    Commands& commands;
    Subscription& subscription;
    JsonOut& out;

    void begin() const {
        out.clear();
        out.open('{').field("driveid", DRIVEID_FORMAT).key("id").integer(id.get<int64_t>()).field("ok", true);
    }
    void ok() const {
        begin();
        out.close('}');
    }
    // A text argument; false where it is missing or too long.
    bool text(const char* key, std::string& value, size_t longest) const {
        const auto it = request.find(key);
        if (it == request.end() || !it->is_string()) return false;
        value = it->get<std::string>();
        return !value.empty() && value.size() <= longest;
    }
};

void names(JsonOut& out, const char* key, const auto& items) {
    out.key(key).open('[');
    for (auto& i : items) out.string(i->config().name);
    out.close(']');
}

void hello(const Context& c, bool write) {
    Gateway& g = c.commands.gateway();
    c.begin();
    c.out.field("version", DRIVEID_VERSION).field("pid", int(getpid())).field("uptime_s", c.commands.uptime_s());
    c.out.field("config_file", g.config().file).field("write", write);
    names(c.out, "drives", g.drives());
    names(c.out, "sources", g.sources());
    names(c.out, "sinks", g.sinks());
    c.out.close('}');
}

void status(const Context& c) {
    c.begin();
    describe_status(c.out, c.commands.gateway(), monotonic_ns());
    c.out.close('}');
}

bool subscribe(const Context& c) {
    Subscription s;
    s.on = true;
    if (const auto it = c.request.find("topics"); it != c.request.end()) {
        if (!it->is_array() || it->size() > 16) return refuse(c.out, c.id, "argument", "topics must be a list of estimate, sample, event, status");
        for (const auto& t : *it) {
            bool* flag = !t.is_string() ? nullptr : t == "estimate" ? &s.estimate : t == "sample" ? &s.sample : t == "event" ? &s.event : t == "status" ? &s.status : nullptr;
            if (!flag) return refuse(c.out, c.id, "argument", "unknown topic; use estimate, sample, event, status");
            *flag = true;
        }
    } else {
        s.estimate = s.event = true;
    }
    if (const auto it = c.request.find("drives"); it != c.request.end()) {
        if (!it->is_array() || it->size() > 256) return refuse(c.out, c.id, "argument", "drives must be a list of names");
        for (const auto& d : *it) {
            if (!d.is_string() || !c.commands.gateway().drive(d.get<std::string>())) return refuse(c.out, c.id, "argument", "unknown drive; hello lists them");
            s.drives.push_back(d.get<std::string>());
        }
    }
    if (const auto it = c.request.find("decimate"); it != c.request.end()) {
        if (!it->is_number_integer() || it->get<int64_t>() < 1 || it->get<int64_t>() > 1000000) return refuse(c.out, c.id, "argument", "decimate must be from 1 to 1000000");
        s.decimate = uint32_t(it->get<int64_t>());
    }
    c.subscription = std::move(s);
    c.ok();
    return true;
}

bool record_stop(const Context& c) {
    Gateway& g = c.commands.gateway();
    if (!g.record()) return refuse(c.out, c.id, "state", "no record is running");
    const std::string path = g.record()->path();
    const uint64_t entries = g.record()->entries();
    uint64_t bytes = 0;
    g.record_stop(bytes);
    c.begin();
    c.out.field("file", path).field("entries", entries).field("bytes", bytes).close('}');
    return true;
}

bool writing(const Context& c, const std::string& cmd) {
    Gateway& g = c.commands.gateway();
    std::string argument;
    if (cmd == "record_start") {
        if (!c.text("file", argument, 200)) return refuse(c.out, c.id, "argument", "file is missing: a bare name such as run.drec");
        const std::string error = g.record_start(argument);
        if (!error.empty()) return refuse(c.out, c.id, "record", error);
        c.begin();
        c.out.field("file", g.record()->path()).close('}');
        return true;
    }
    if (cmd == "record_stop") return record_stop(c);
    if (cmd == "mark") {
        if (!c.text("text", argument, 4000)) return refuse(c.out, c.id, "argument", "text is missing, or longer than 4000 characters");
        g.mark(argument);
    } else if (cmd == "restart") {
        if (!c.text("drive", argument, 200) || !g.drive(argument)) return refuse(c.out, c.id, "argument", "unknown drive; hello lists them");
        g.drive(argument)->restart();
    } else {
        std::vector<std::string> changed;
        const std::string error = c.commands.reload(changed);
        if (!error.empty()) return refuse(c.out, c.id, "config", "the old configuration stays: " + error);
        c.begin();
        c.out.key("changed").open('[');
        for (const auto& n : changed) c.out.string(n);
        c.out.close(']').close('}');
        return true;
    }
    c.ok();
    return true;
}

bool too_deep(std::string_view line) {
    int depth = 0;
    bool in_string = false;
    for (size_t i = 0; i < line.size(); ++i) {
        const char c = line[i];
        if (in_string) {
            if (c == '\\') ++i;
            else if (c == '"') in_string = false;
        } else if (c == '"') {
            in_string = true;
        } else if (c == '{' || c == '[') {
            if (++depth > kDepthMax) return true;
        } else if (c == '}' || c == ']') {
            --depth;
        }
    }
    return false;
}

}  // namespace

void answer_request(std::string_view line, bool may_write, Commands& commands, Subscription& subscription, JsonOut& out) {
    static const char* const writers[] = {"record_start", "record_stop", "mark", "restart", "reload"};
    const json none;
    if (too_deep(line)) return void(refuse(out, none, "format", "nested deeper than 8"));
    const json request = json::parse(line, nullptr, false);
    if (!request.is_object()) return void(refuse(out, none, "format", "a request is one JSON object on one line"));
    const json id = request.value("id", json());
    if (!id.is_number_integer()) return void(refuse(out, none, "format", "\"id\" must be an integer"));
    const auto version = request.find("driveid");
    if (version != request.end() && *version != DRIVEID_FORMAT) return void(refuse(out, id, "version", "this daemon speaks \"driveid\": 1"));
    const auto cmd_it = request.find("cmd");
    const std::string cmd = cmd_it != request.end() && cmd_it->is_string() ? cmd_it->get<std::string>() : "";
    const Context c{request, id, commands, subscription, out};
    if (cmd == "hello") return hello(c, may_write);
    if (cmd == "status") return status(c);
    if (cmd == "subscribe") return void(subscribe(c));
    if (cmd == "unsubscribe") {
        subscription = {};
        return c.ok();
    }
    if (std::find(std::begin(writers), std::end(writers), cmd) == std::end(writers))
        return void(refuse(out, id, "command", "unknown command; there are hello, status, subscribe, unsubscribe, record_start, record_stop, mark, restart, reload"));
    if (!may_write) return void(refuse(out, id, "permission", "this command writes: set [control] write_group and be a member of that group"));
    writing(c, cmd);
}

}  // namespace gw
