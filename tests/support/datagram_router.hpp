#pragma once
#include <ise/core/buffer.hpp>
#include <ise/core/task_scope.hpp>
#include <ise/sim/world.hpp>

#include <functional>
#include <memory>
#include <vector>

namespace ise_test {

/// A router of the virtual world between the one who calls it (udp, port 9000) and another host. It may forget by which
/// port a conversation goes, and change what it passes on.
class datagram_router {
public:
    /// May change a datagram; an empty one is not passed on.
    using meddler = std::function<void(ise::buffer&)>;

    datagram_router(ise::sim::process& process, ise::endpoint to)
        : host_(process.make_loop("main")), on_(host_->loop()), target_(std::move(to)),
          scope_(on_, [](const std::string&, std::exception_ptr) {}),
          inside_(on_.env().open_datagram(on_, ise::endpoint::parse("udp://0.0.0.0:9000").value()).value()) {
        scope_.spawn("inside", from_inside(*this));
        forget();
    }
    /// What follows comes from another port; what is sent to the old one goes nowhere.
    void forget() {
        outside_.push_back(on_.env().open_datagram(on_, ise::endpoint::parse("udp://0.0.0.0:0").value()).value());
        scope_.spawn("outside", from_outside(*this, outside_.back().get()));
    }
    void stop(ise::sim::world& world) {
        scope_.stop();
        world.run_until([this] { return scope_.size() == 0; });
    }

    meddler on_question, on_answer;

private:
    static void pass(ise::datagram_socket& by, const ise::endpoint& to, const ise::datagram& came,
                     const meddler& change) {
        ise::buffer content;
        content.append(came.content);
        if (change) change(content);
        if (!content.empty()) by.try_send(to, content.view());
    }
    static ise::task<> from_inside(datagram_router& of) {
        for (;;) {
            auto came = co_await of.inside_->receive();
            if (came.first) co_return;
            of.client_ = came.second->peer;
            pass(*of.outside_.back(), of.target_, *came.second, of.on_question);
        }
    }
    static ise::task<> from_outside(datagram_router& of, ise::datagram_socket* which) {
        for (;;) {
            auto came = co_await which->receive();
            if (came.first) co_return;
            if (which == of.outside_.back().get()) pass(*of.inside_, of.client_, *came.second, of.on_answer);
        }
    }

    std::unique_ptr<ise::loop_host> host_;
    ise::loop& on_;
    ise::endpoint target_, client_;
    ise::task_scope scope_;
    std::unique_ptr<ise::datagram_socket> inside_;
    std::vector<std::unique_ptr<ise::datagram_socket>> outside_;
};

} // namespace ise_test
