#include <ise/ise.hpp>

#include <fmt/core.h>

using namespace std::chrono_literals;

struct set_mode {
    std::string mode;
};
struct mode_set {
    bool accepted = false;
    std::string reason;
};

inline constexpr ise::request_response<set_mode, mode_set> helm{"helm"};

class boat : public ise::component {
    ise::task<> run() override {
        provide(helm, [this](set_mode rq) {
            if (rq.mode == "fly") return mode_set{false, "boats sail"};
            mode_ = rq.mode;
            return mode_set{true, ""};
        });
        co_return; // its flow is over; its services go on
    }
    std::string mode_ = "moored";
};

class shore : public ise::component {
    ise::task<> run() override {
        auto boat = co_await find("tutorial/boat");
        for (const std::string mode : {"hold", "fly"}) {
            auto reply = co_await boat.call(helm, mode, 2s);
            fmt::print("{}: {}\n", mode, reply.accepted ? "accepted" : reply.reason);
        }
        stop();
    }
};

int main() {
    ise::real_environment env;
    ise::node boats(env), people(env); // a node finds the name server by ISE_NAME_SERVER
    boats.start<boat>("tutorial/boat");
    people.start<shore>("tutorial/shore");
    return ise::run_until_signal(people); // the shore ends by itself; the boat with its node
}
