#pragma once
#include "mission.hpp"

#include <ise/component/component.hpp>

#include <functional>
#include <map>
#include <vector>

namespace atirma::stress {

/// Does what the plan says, when it says it.
class mission::script final : public ise::component {
public:
    explicit script(mission& of) : of_(of) {}

private:
    struct event {
        ise::duration at{};
        std::function<void()> what;
    };
    ise::task<> run() override;
    ise::task<bool> see_the_boat();
    ise::task<> learn();
    void begin(const fault& what);
    void end(const fault& what);
    void take_sample();
    bool nothing_owed();
    std::vector<event> timetable();

    mission& of_;
    std::map<trouble, std::size_t> open_;
};

} // namespace atirma::stress
