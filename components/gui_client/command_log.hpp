#pragma once
#include <components/gui_client/view.hpp>

#include <deque>
#include <memory>
#include <vector>

namespace atirma::console {

/// Everybody's telecommands, as far as they were heard of: those given here, and those that the proxies tell of. Pure,
/// bounded: the oldest that is over gives way, then the oldest.
class command_log {
public:
    explicit command_log(std::size_t most = 300) : most_(most) {}

    /// One that is given here.
    void asked(command_entry entry);
    /// A proxy tells of a change; also of a command that nobody here gave. Gives the entry as it is now.
    const command_entry& on_status(const std::string& path, const telecommand_status& status, utc_time now);
    /// What became of one that was given here. What is over stays so, unless the boat answers after all.
    void on_outcome(std::uint32_t id, command_phase phase, std::optional<float> value, std::string text, utc_time now);
    const command_entry* find(std::uint32_t id) const;
    /// Not over yet, over that proxy.
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
