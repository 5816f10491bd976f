// The relay of datagrams.
#include <support/relay_kinds.hpp>

#include <ise/core/task_scope.hpp>

#include <map>
#include <vector>

namespace ise_test {
namespace {

// What becomes of datagrams in one direction.
class rough_way {
public:
    // Calls `send` with what goes out now that `content` came.
    template <class Send>
    void pass(bool rough, ise::bytes_view content, Send send) {
        if (!rough) return send(content);
        const auto number = ++passed_;
        if (number % 9 == 0) return;
        if (number % 7 == 0) {
            late_.assign(content.begin(), content.end());
            return;
        }
        send(content);
        if (number % 2 == 0) send(content);
        if (!late_.empty()) send(std::exchange(late_, {}));
    }

private:
    std::uint64_t passed_ = 0;
    ise::bytes late_;
};

// The datagrams of one requester.
struct conversation {
    ise::endpoint client;
    std::vector<std::shared_ptr<ise::datagram_socket>> outside; // the last one counts
    rough_way onwards, back;
    bool swallowed = false;
};

class datagram_relay final : public relay {
public:
    datagram_relay(ise::environment& env, std::unique_ptr<ise::loop_host> host, const ise::endpoint& at,
                   ise::endpoint to)
        : env_(env), host_(std::move(host)), on_(host_->loop()), target_(std::move(to)),
          inside_(env.open_datagram(on_, at).value()), scope_(on_, [](const std::string&, std::exception_ptr) {}) {
        scope_.spawn("inside", from_inside(*this));
    }
    ise::endpoint where() const override { return inside_->where(); }
    void hold() override { held_ = true; }
    void go_on() override { held_ = false; }
    void swallow() override {
        for (auto& [client, one] : conversations_) one->swallowed = true;
    }
    void forget() override {
        for (auto& [client, one] : conversations_) renumber(one);
    }
    void roughen() override { rough_ = true; }
    void stop() override { scope_.stop(); }
    bool ended() const override { return scope_.size() == 0; }

private:
    // What follows comes from another port; what is sent to the old one goes nowhere.
    void renumber(const std::shared_ptr<conversation>& of) {
        auto at = inside_->where();
        at.port = 0;
        of->outside.push_back(env_.open_datagram(on_, at).value());
        scope_.spawn("outside", from_outside(*this, of, of->outside.back()));
    }
    static ise::task<> from_inside(datagram_relay& of) {
        for (;;) {
            auto came = co_await of.inside_->receive();
            if (came.first) co_return;
            auto& known = of.conversations_[came.second->peer];
            if (!known) {
                known = std::make_shared<conversation>();
                known->client = came.second->peer;
                of.renumber(known);
            }
            if (of.held_ || known->swallowed) continue;
            known->onwards.pass(of.rough_, came.second->content,
                                [&](ise::bytes_view content) { known->outside.back()->try_send(of.target_, content); });
        }
    }
    static ise::task<> from_outside(datagram_relay& of, std::shared_ptr<conversation> with,
                                    std::shared_ptr<ise::datagram_socket> which) {
        for (;;) {
            auto came = co_await which->receive();
            if (came.first) co_return;
            if (which != with->outside.back() || of.held_ || with->swallowed) continue;
            with->back.pass(of.rough_, came.second->content,
                            [&](ise::bytes_view content) { of.inside_->try_send(with->client, content); });
        }
    }

    ise::environment& env_;
    std::unique_ptr<ise::loop_host> host_;
    ise::loop& on_;
    ise::endpoint target_;
    std::unique_ptr<ise::datagram_socket> inside_;
    std::map<ise::endpoint, std::shared_ptr<conversation>> conversations_;
    bool held_ = false, rough_ = false;
    ise::task_scope scope_;
};

} // namespace

std::unique_ptr<relay> make_datagram_relay(ise::environment& env, std::unique_ptr<ise::loop_host> host,
                                           const ise::endpoint& at, const ise::endpoint& to) {
    return std::make_unique<datagram_relay>(env, std::move(host), at, to);
}
std::unique_ptr<relay> relay::make(ise::environment& env, std::unique_ptr<ise::loop_host> host, const ise::endpoint& at,
                                   const ise::endpoint& to) {
    if (to.kind == ise::protocol::udp) return make_datagram_relay(env, std::move(host), at, to);
    return make_byte_relay(env, std::move(host), at, to);
}

} // namespace ise_test
