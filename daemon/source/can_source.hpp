// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <memory>

#include "base/loop.hpp"
#include "source/can_port.hpp"
#include "source/source.hpp"

namespace gw {

class CanSource final : public Source {
public:
    CanSource(const SourceConfig& config, int index, Consumer& consumer, Loop& loop, std::unique_ptr<CanPort> port);
    ~CanSource() override;
    void start() override { open(); }
    bool can_send() const override { return true; }
    bool send(const canfd_frame& frame, bool fd) override;
    std::string address() const override { return port_->address(); }
    bool waiting() const override;

private:
    void open();
    void lost(int error_number);
    void readable();
    void take(const CanBatch& batch);
    void error_frame(const canfd_frame& frame);
    void again();

    Loop& loop_;
    std::unique_ptr<CanPort> port_;
    int fd_ = -1;
    Timer retry_;
    int64_t backoff_ns_;
    CanBatch batch_;
};

}  // namespace gw
