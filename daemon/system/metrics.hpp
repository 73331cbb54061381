// SPDX-License-Identifier: Apache-2.0
// Prometheus text page on loopback: one GET, one answer, connection closed.
#pragma once
#include <memory>
#include <string>
#include <vector>

#include "base/loop.hpp"

namespace gw {

class Commands;

class Metrics {
public:
    // Throws std::runtime_error with the mend.
    Metrics(const std::string& address, Loop& loop, Commands& commands);
    ~Metrics();

private:
    struct Client { Fd fd; std::string input; };
    void accept_one();
    void readable(Client& c);
    std::string page() const;

    Loop& loop_;
    Commands& commands_;
    Fd listener_;
    std::vector<std::unique_ptr<Client>> clients_;
};

}  // namespace gw
