// A name server with many names: how long they take to register, resolves a second, and how long it takes until a
// server that was started again knows them all.
#include "collector.hpp"
#include "programs.hpp"

#include <ise/name_server/name_server.hpp>
#include <ise/service/service_host.hpp>

#include <cstdio>

namespace bench {
namespace {

constexpr std::size_t services_each = 10;
constexpr std::size_t asked_at_once = 64;
constexpr auto lease = std::chrono::seconds(2);

// One of many: it provides ten services, and says no more.
class named final : public ise::component {
    ise::task<> run() override {
        for (std::size_t i = 0; i != services_each; ++i) {
            const ise::request_response<ask_memory, memory_used> service(echo_name(i));
            provide(service, [](ask_memory) { return memory_used(); });
        }
        co_return;
    }
};

std::string name_of(std::size_t number) { return "bench/named/" + std::to_string(number); }

class asker final : public ise::component {
public:
    asker(ise::endpoint server, std::size_t names) : server_(std::move(server)), names_(names) {}

    /// Completes when the server knows all; gives the seconds since `since_ns`.
    ise::task<double> until_whole(std::int64_t since_ns) {
        auto peer = at(server_);
        for (;;) {
            ise::naming::list_request all;
            all.prefix = "bench/named";
            std::size_t known = 0;
            for (bool more = true; more;) {
                auto page = co_await peer.try_call(ise::naming::list, all, generous);
                if (!page) break;
                known += page->names.size();
                more = page->more && !page->names.empty();
                if (more) all.after = page->names.back().path;
            }
            if (known == names_) co_return static_cast<double>(now_ns() - since_ns) * 1e-9;
            co_await sleep(std::chrono::milliseconds(20));
        }
    }

    ise::task<double> resolves_per_s(double seconds) {
        auto peer = at(server_);
        resolved_ = 0;
        done_ = false;
        for (std::size_t i = 0; i != asked_at_once; ++i) resolve_again(peer, i * 131);
        const auto began = now_ns();
        co_await sleep(std::chrono::nanoseconds(static_cast<std::int64_t>(seconds * 1e9)));
        const auto rate = static_cast<double>(resolved_) / (static_cast<double>(now_ns() - began) * 1e-9);
        done_ = true;
        while (running_ != 0) co_await sleep(std::chrono::milliseconds(1));
        if (failed_) throw ise::error(*failed_);
        co_return rate;
    }

private:
    ise::task<> run() override { co_return; }

    void resolve_again(const ise::remote& peer, std::size_t number) {
        ++running_;
        ise::naming::resolve_request wanted;
        wanted.path = name_of(number % names_);
        peer.try_call(ise::naming::resolve, std::move(wanted), generous,
                      [this, peer, number](ise::result<ise::naming::resolve_response> found) {
                          --running_;
                          if (!found) failed_ = found.error();
                          else ++resolved_;
                          if (found && !done_) resolve_again(peer, number + 7919);
                      });
    }

    ise::endpoint server_;
    std::size_t names_;
    std::uint64_t resolved_ = 0;
    std::size_t running_ = 0;
    bool done_ = false;
    std::optional<ise::failure> failed_;
};

struct server {
    explicit server(ise::environment& env, const ise::endpoint& at) : node(env, node_options()) {
        ise::component_options how;
        how.listen = {at};
        how.registers = false;
        where = node.start<ise::name_server>(std::string(ise::naming::server_path), std::move(how))
                    .services()
                    .listening()
                    .front();
    }
    ~server() {
        node.stop();
        node.wait();
    }
    ise::node node;
    ise::endpoint where;
};

} // namespace

void measure_names(const options& asked) {
    ise::real_environment env;
    auto first = std::make_unique<server>(env, ise::endpoint::parse("tcp://127.0.0.1:0").value());
    const auto where = first->where;
    auto options = node_options();
    options.use_names = true;
    options.name_server = where;
    options.lease = lease;
    ise::node crowd(env, options);
    ise::node others(env, node_options());
    auto& asking_one = others.start<asker>("bench/asker", asking(), where, asked.outstanding);

    const auto began = now_ns();
    for (std::size_t i = 0; i != asked.outstanding; ++i) {
        ise::component_options how;
        how.listen = {ise::endpoint::parse("inproc://bench-named-" + std::to_string(i)).value()};
        if (i != 0) how.together_with = name_of(0);
        crowd.start<named>(name_of(i), std::move(how));
    }
    const auto registered = asking_one.wait(asking_one.until_whole(began));
    const auto rate = asking_one.wait(asking_one.resolves_per_s(asked.seconds));
    first.reset();
    const auto gone = now_ns();
    const server second(env, where);
    const auto whole_again = asking_one.wait(asking_one.until_whole(gone));
    std::printf("{\"work\":\"names\",\"components\":%zu,\"services\":%zu,\"registered_s\":%.2f,\"resolves_per_s\":%.0f,"
                "\"whole_again_s\":%.2f,"
                "\"lease_s\":%lld}\n",
                asked.outstanding, asked.outstanding * services_each, registered, rate, whole_again,
                static_cast<long long>(lease.count()));
    std::fflush(stdout);
    crowd.stop();
    others.stop();
    crowd.wait();
    others.wait();
}

} // namespace bench
