// What a user's first file costs to compile: one packet each way, one call (bench/compile).
#include <ise/ise.hpp>

#include <chrono>
#include <memory>
#include <string>

using namespace std::chrono_literals;

struct set_mode {
    std::string mode;
};
struct mode_set {
    bool accepted;
    std::string reason;
};

inline constexpr ise::request_response<set_mode, mode_set> helm{"helm"};

class console : public ise::component {
    ise::task<> run() override {
        auto boat = co_await find("atirma/boat");
        set_mode hold{"hold"};
        auto reply = co_await boat.call(helm, hold, 2s);
        accepted_ = reply.accepted;
    }

    bool accepted_ = false;
};

// So that it is used, and code is made of it.
std::unique_ptr<ise::component> make_console() { return std::make_unique<console>(); }
