#pragma once
#include <components/gui_client/view.hpp>

#include <deque>
#include <memory>
#include <vector>

namespace atirma::console {

/// The telecommands of all operators, as far as they are known: those given here, and those that the proxies report.
/// Pure, bounded: the oldest one that is over is removed first, then the oldest.
class command_log {
public:
    explicit command_log(std::size_t most = 300) : most_(most) {}

    /// A telecommand is given here.
    void asked(command_entry entry);
    /// A proxy reports a change, also of a telecommand of another console. Returns the updated entry.
    const command_entry& on_status(const std::string& path, const telecommand_status& status, utc_time now);
    /// The outcome of a telecommand given here. One that is over does not change any more, unless the boat answers
    /// late.
    void on_outcome(std::uint32_t id, command_phase phase, std::optional<float> value, std::string text, utc_time now);
    void on_executed(std::uint32_t id, utc_time at);
    void on_called_back(std::uint32_t id, std::string text);
    const command_entry* find(std::uint32_t id) const;
    /// The number of telecommands over that proxy that are not over yet.
    std::size_t open(const std::string& path) const;
    /// The same object until something changes. Oldest first.
    std::shared_ptr<const std::vector<command_entry>> entries();

    static command_phase phase_of(telecommand_stage stage, const std::optional<ack_code>& result) noexcept;

private:
    command_entry* seek(std::uint32_t id);
    command_entry& add(command_entry entry);

    std::size_t most_;
    std::deque<command_entry> entries_;
    std::shared_ptr<const std::vector<command_entry>> shared_;
};

} // namespace atirma::console
