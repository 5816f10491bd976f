#pragma once
#include <ise/sim/world.hpp>
#include <support/party.hpp>

namespace ise_test {

/// Parties of a virtual world, each a process on a host of its own unless told otherwise.
class sim_parties {
public:
    explicit sim_parties(std::uint64_t seed = 1) : world(seed) {}
    ~sim_parties() { stop(); }

    /// Stops all parties in order and waits until nothing of them runs.
    bool stop() {
        for (auto& one : parties_) {
            if (!one->scope.stopping()) one->services->stop(std::chrono::milliseconds(100));
            one->scope.stop();
        }
        return world.run_until([&] {
            return std::all_of(parties_.begin(), parties_.end(), [](auto& one) { return one->scope.size() == 0; });
        });
    }

    party& add(const std::string& host, ise::service_options options = {},
               const ise::security_options& credentials = {}) {
        auto& process = world.host(host).start_process(host);
        parties_.push_back(std::make_unique<party>(process, process.make_loop("main"), host, options,
                                                   ise::security::load(process, credentials).value()));
        return *parties_.back();
    }
    bool run_until(const std::function<bool()>& done) { return world.run_until(done); }
    template <class T>
    T run(party& on, ise::task<T> body) {
        auto state = start(on.on, std::move(body));
        if (!world.run_until([&] { return state->done; })) throw std::logic_error("it did not end within an hour");
        if constexpr (std::is_void_v<T>) {
            state->get();
        } else {
            return std::move(state->get());
        }
    }

    ise::sim::world world;

private:
    std::vector<std::unique_ptr<party>> parties_;
};

} // namespace ise_test
