// SPDX-License-Identifier: Apache-2.0
// Any line as request: one answer, itself a JSON object, with "ok" and the version.
#include <nlohmann/json.hpp>

#include "control/server.hpp"
#include "fuzz.hpp"

namespace {

struct Commands final : gw::Commands {
    Commands() {
        gw::log_level(gw::Level::error);
        gateway_ = std::make_unique<gw::Gateway>(gw::config_read_text(kFuzzConfig, "x").config, loop_, nullptr);
    }
    gw::Gateway& gateway() override { return *gateway_; }
    std::string reload(std::vector<std::string>&) override { return "no"; }
    double uptime_s() const override { return 1; }
    gw::Loop loop_;
    std::unique_ptr<gw::Gateway> gateway_;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    static Commands commands;
    static gw::JsonOut out;
    if (size > 65536) return 0;
    gw::Subscription subscription;
    // With the right to write only where the line could not start a record: a fuzzer writes no files.
    const bool write = text_of(data, size).find("record") == std::string_view::npos && text_of(data, size).find('\\') == std::string_view::npos;
    out.clear();
    gw::answer_request(text_of(data, size), write, commands, subscription, out);
    const auto answer = nlohmann::json::parse(out.text(), nullptr, false);
    HOLDS(answer.is_object() && answer["driveid"] == 1 && answer["ok"].is_boolean());
    HOLDS(answer["ok"] == true || (answer["error"].is_string() && answer["message"].is_string()));
    return 0;
}
