#pragma once
#include "fleet.hpp"

namespace seeds {

/// Makes the faults of a plan happen, tells the weather of them, and ends them all at the end of the storms.
class storms {
public:
    storms(stage& of, fleet& ships) : stage_(of), fleet_(ships) {}

    void schedule();
    /// Whatever is still broken is put right; processes that are down start.
    void end();
    /// After each event: faults that end by themselves.
    void look();

private:
    void begin(const fault_plan& what);
    void part(const std::string& a, const std::string& b);
    void heal(const std::string& a, const std::string& b);
    void disturb(const std::string& host, ise::duration length, std::function<void()> back);
    void rival(const fault_plan& what);
    ise::duration left() const;
    void later(ise::duration length, std::function<void()> back);

    stage& stage_;
    fleet& fleet_;
    std::map<std::pair<std::string, std::string>, int> parted_;
    std::vector<std::pair<std::string, std::string>> cuts_;
    bool io_breaks_ = false;
    std::uint64_t cut_count_ = 0;
    ise::duration until_{}; // when the storms end, since the world began
};

} // namespace seeds
