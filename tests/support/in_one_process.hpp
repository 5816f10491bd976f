#pragma once
#include <ise/sim/world.hpp>
#include <support/party.hpp>

namespace ise_test {

/// Parties of one virtual process, on one loop or on a loop each: what lies between them is in-process.
class in_one_process {
public:
    explicit in_one_process(bool one_loop, std::uint64_t seed = 1)
        : world(seed), process_(world.host("boat").start_process("boat")), one_loop_(one_loop) {}
    ~in_one_process() { stop(); }

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

    party& add(const std::string& path, ise::service_options options = {}) {
        std::unique_ptr<ise::loop_host> loop;
        if (one_loop_ && !parties_.empty()) loop = std::make_unique<borrowed>(parties_.front()->on);
        else loop = process_.make_loop(path);
        parties_.push_back(std::make_unique<party>(process_, std::move(loop), path, options));
        return *parties_.back();
    }
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
    class borrowed final : public ise::loop_host {
    public:
        explicit borrowed(ise::loop& of) : of_(of) {}
        ise::loop& loop() noexcept override { return of_; }
        void end() override {}

    private:
        ise::loop& of_;
    };

    ise::sim::process& process_;
    const bool one_loop_;
    struct backwards { // the loop of the first is gone last
        std::vector<std::unique_ptr<party>> all;
        ~backwards() {
            while (!all.empty()) all.pop_back();
        }
    } owned_;
    std::vector<std::unique_ptr<party>>& parties_ = owned_.all;
};

} // namespace ise_test
