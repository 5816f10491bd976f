// A program that is not well, in a process of its own, for `ise doctor` to find out.
// usage: doctor_patient NAME_SERVER LEASE_S AILMENT: floods|slow|asks|gives|seeks|early|nowhere|passes|left|right
#include <ise/ise.hpp>

#include <asio/any_io_executor.hpp>

#include <cstdio>
#include <cstdlib>
#include <string>
#include <utility>

namespace {

using namespace std::chrono_literals;

struct chunk {
    std::uint64_t number = 0;
    std::string filling = std::string(60'000, 'x');
};
struct rest {
    std::uint32_t milliseconds = 20;
};
struct order {
    double heading_deg = 0;
};
struct other_order {
    std::string heading;
};
inline constexpr ise::subscription<chunk> chunks{"chunks"};
inline constexpr ise::request_response<rest, rest> nap{"nap"};
inline constexpr ise::request_response<rest, rest> pass{"pass"};
inline constexpr ise::request_response<rest, rest> left{"left"};
inline constexpr ise::request_response<rest, rest> right{"right"};
inline constexpr ise::request_response<order, ise::nothing> steer{"steer"};
inline constexpr ise::request_response<other_order, ise::nothing> steer_otherwise{"steer"};

class patient final : public ise::component {
public:
    explicit patient(std::string ailment) : ailment_(std::move(ailment)) {}

private:
    ise::task<> run() override {
        if (ailment_ == "asks") require(steer);
        if (ailment_ == "gives") provide(steer_otherwise, [](other_order) { return ise::nothing{}; });
        if (ailment_ == "seeks") spawn("search", seek());
        if (ailment_ == "slow") {
            ise::serve_options alone;
            alone.concurrent = 1;
            alone.waiting = 4;
            auto handler = [this](rest rq) -> ise::task<rest> {
                co_await sleep(std::chrono::milliseconds(rq.milliseconds));
                co_return rq;
            };
            provide(nap, handler, alone);
        }
        if (ailment_ == "passes")
            provide(pass, [this](rest rq) -> ise::task<rest> { return ask("ward/slow", nap, rq); });
        // Each waits for the other one, whose only handler waits for it.
        if (ailment_ == "left")
            provide_exclusive(left, [this](rest rq) -> ise::task<rest> { return ask("ward/right", right, rq); });
        if (ailment_ == "right") {
            provide_exclusive(right, [this](rest rq) -> ise::task<rest> { return ask("ward/left", left, rq); });
            spawn("first question", begin());
        }
        auto out = publish(chunks);
        for (chunk next; ailment_ == "floods"; ++next.number) {
            out(next);
            co_await sleep(5ms);
        }
        co_await sleep(24h);
    }
    // As the README's requester, which is started before its provider.
    ise::task<> seek() {
        auto gives = co_await find("ward/gives");
        other_order rq{"north"};
        co_await gives.call(steer_otherwise, rq, 60s);
        co_await sleep(24h);
    }
    template <class Service>
    ise::task<rest> ask(std::string whom, Service service, rest request) {
        auto other = co_await find(whom);
        auto answer = co_await other.call(service, request, 10min);
        co_return answer;
    }
    ise::task<> begin() {
        rest request;
        co_await ask("ward/left", left, request);
    }
    std::string ailment_;
};

/// The real world with a clock that was set wrong, or as seen from another machine.
class elsewhere final : public ise::environment {
public:
    elsewhere(ise::duration ahead, bool another_machine) : ahead_(ahead), identity_(real_.identity()) {
        if (another_machine) identity_.host_key += "-another";
    }

    ise::wall_time wall() const override { return real_.wall() + ahead_; }

    ise::time_point now() const override { return real_.now(); }
    std::uint64_t random() override { return real_.random(); }
    const ise::process_identity& identity() const override { return identity_; }
    std::optional<std::string> variable(const std::string& name) const override { return real_.variable(name); }
    std::unique_ptr<ise::loop_host> make_loop(const std::string& name) override { return real_.make_loop(name); }
    std::unique_ptr<ise::loop_host> adopt(asio::any_io_executor executor, bool one_thread) override {
        return real_.adopt(std::move(executor), one_thread);
    }
    void offload(std::function<void()> work) override { real_.offload(std::move(work)); }
    bool is_virtual() const noexcept override { return false; }
    ise::task<ise::result<std::unique_ptr<ise::stream>>> connect(ise::loop& on, ise::endpoint to) override {
        return real_.connect(on, std::move(to));
    }
    ise::result<std::unique_ptr<ise::listener>> listen(ise::loop& on, const ise::endpoint& at) override {
        return real_.listen(on, at);
    }
    ise::result<std::unique_ptr<ise::datagram_socket>> open_datagram(ise::loop& on, const ise::endpoint& at) override {
        return real_.open_datagram(on, at);
    }
    ise::result<std::unique_ptr<ise::stream>> open_serial(ise::loop& on, const ise::serial_options& options) override {
        return real_.open_serial(on, options);
    }
    ise::result<ise::pseudo_terminal> open_pseudo_terminal(ise::loop& on, const std::string& link) override {
        return real_.open_pseudo_terminal(on, link);
    }
    ise::result<std::string> read_file(const std::string& path, std::size_t most) override {
        return real_.read_file(path, most);
    }
    ise::result<std::string> read_secret(const std::string& path, std::size_t most) override {
        return real_.read_secret(path, most);
    }
    std::vector<std::string> interface_addresses() const override { return real_.interface_addresses(); }

private:
    ise::real_environment real_;
    ise::duration ahead_;
    ise::process_identity identity_;
};

} // namespace

int main(int count, char** words) {
    if (count != 4) return 2;
    try {
        std::string ailment = words[3];
        elsewhere env(ailment == "early" ? 1h : 0h, ailment == "nowhere");
        ise::node_options options;
        options.log = ise::log_to_stderr(ise::log_level::info);
        options.lease = std::chrono::seconds(std::atoi(words[2]));
        options.name_servers = {ise::endpoint::parse(words[1]).value()};
        ise::node node(env, std::move(options));
        ise::component_options where;
        where.listen = {ise::endpoint::parse("tcp://127.0.0.1:0").value()};
        // Of the addresses for documentation (RFC 5737): nobody listens there.
        if (ailment == "nowhere") where.advertise = {ise::endpoint::parse("tcp://192.0.2.1:7411").value()};
        auto& started = node.start<patient>("ward/" + ailment, std::move(where), ailment);
        started.wait(started.ready());
        return ise::run_until_signal(node, [] {
            std::printf("ready\n");
            std::fflush(stdout);
        });
    } catch (const std::exception& why) {
        std::fprintf(stderr, "doctor_patient: %s\n", why.what());
        return 1;
    }
}
