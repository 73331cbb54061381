// SPDX-License-Identifier: Apache-2.0
// JSON writer into a buffer that keeps its capacity: no allocation once it has grown to the largest message.
#pragma once
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <string>
#include <string_view>

namespace gw {

class JsonOut {
public:
    explicit JsonOut(size_t reserve = 65536) { text_.reserve(reserve); }

    void clear() { text_.clear(); comma_ = false; }
    const std::string& text() const { return text_; }
    void newline() { if (text_.empty() || text_.back() != '\n') text_ += '\n'; }

    JsonOut& open(char bracket) { separate(); text_ += bracket; comma_ = false; return *this; }
    JsonOut& close(char bracket) { text_ += bracket; comma_ = true; return *this; }
    JsonOut& key(std::string_view name) {
        string(name);
        text_ += ':';
        comma_ = false;
        return *this;
    }
    JsonOut& string(std::string_view s) {
        separate();
        text_ += '"';
        for (char c : s) escape(c);
        text_ += '"';
        return *this;
    }
    JsonOut& integer(int64_t v) { return print("%lld", (long long)v); }
    JsonOut& number(double v) { return std::isfinite(v) ? print("%.17g", v) : null(); }
    JsonOut& boolean(bool v) { separate(); text_ += v ? "true" : "false"; return *this; }
    JsonOut& null() { separate(); text_ += "null"; return *this; }
    JsonOut& raw(std::string_view json) { separate(); text_ += json; return *this; }

    JsonOut& field(std::string_view name, std::string_view v) { return key(name).string(v); }
    JsonOut& field(std::string_view name, const char* v) { return key(name).string(v); }
    JsonOut& field(std::string_view name, double v) { return key(name).number(v); }
    JsonOut& field(std::string_view name, int64_t v) { return key(name).integer(v); }
    JsonOut& field(std::string_view name, uint64_t v) { return key(name).integer(int64_t(v)); }
    JsonOut& field(std::string_view name, int v) { return key(name).integer(v); }
    JsonOut& field(std::string_view name, uint32_t v) { return key(name).integer(v); }
    JsonOut& field(std::string_view name, bool v) { return key(name).boolean(v); }

private:
    void separate() {
        if (comma_) text_ += ',';
        comma_ = true;
    }
    JsonOut& print(const char* format, auto v) {
        separate();
        char buffer[40];
        const int n = snprintf(buffer, sizeof buffer, format, v);
        text_.append(buffer, size_t(n));
        return *this;
    }
    // Bytes that are no UTF-8 (a peer's text quoted back) would make the whole line unreadable: they become '?'.
    void escape(char c) {
        const auto u = uint8_t(c);
        if (c == '"' || c == '\\') { text_ += '\\'; text_ += c; }
        else if (c == '\n') text_ += "\\n";
        else if (u < 0x20 || u >= 0x7F) text_ += '?';
        else text_ += c;
    }
    std::string text_;
    bool comma_ = false;
};

}  // namespace gw
