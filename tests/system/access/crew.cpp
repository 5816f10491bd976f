// A boat and its watch, each in a process of its own, for `ise access learn` to watch.
#include <ise/component/component_type.hpp>
#include <ise/ise.hpp>

#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>
#include <vector>

namespace {

using namespace std::chrono_literals;

struct order {
    double heading_deg = 0;
};
struct fix {
    std::uint64_t number = 0;
};
inline constexpr ise::request_response<order, order> helm{"helm"};
inline constexpr ise::request_response<order, order> scuttle{"scuttle"};
inline constexpr ise::subscription<fix> position{"position"};
inline constexpr ise::subscription<fix> secrets{"secrets"};

struct no_options {};

class boat final : public ise::component {
public:
    explicit boat(const no_options&) {}

private:
    ise::task<> run() override {
        auto turn = [](order rq) { return rq; };
        provide(helm, turn);
        provide(scuttle, turn);
        auto unseen = publish(secrets);
        auto out = publish(position);
        for (fix now;; ++now.number) {
            out(now);
            co_await sleep(20ms);
        }
    }
};

/// Prints "kept" for each turn at the helm with a fix behind it, and why one failed.
class watch final : public ise::component {
public:
    explicit watch(const no_options&) {}

private:
    ise::task<> run() override {
        auto ship = co_await find("robots/boat");
        auto fixes = co_await ship.subscribe(position);
        for (;;) {
            co_await fixes.next();
            order rq{90};
            auto turned = co_await ship.try_call(helm, rq, 5s);
            print(turned ? "kept" : turned.error().message());
            order never{0};
            if (told_to_scuttle()) {
                auto sunk = co_await ship.try_call(scuttle, never, 5s);
                print(sunk ? "scuttled" : sunk.error().message());
            }
            co_await sleep(50ms);
        }
    }
    static bool told_to_scuttle() { return std::getenv("CREW_SCUTTLES") != nullptr; }
    static void print(const std::string& text) {
        std::puts(text.c_str());
        std::fflush(stdout);
    }
};

template <class C>
ise::component_type type_of(const std::string& name) {
    ise::component_type made(name, "one of the crew", "robots/" + name);
    made.makes<C>(std::make_shared<no_options>());
    return made;
}

std::vector<ise::component_type> types() {
    std::vector<ise::component_type> made;
    made.push_back(type_of<boat>("boat"));
    made.push_back(type_of<watch>("watch"));
    return made;
}

} // namespace

int main(int count, char** words) { return ise::main(count, words, types, "1"); }
