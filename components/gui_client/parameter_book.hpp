#pragma once
#include <components/gui_client/view.hpp>

#include <map>
#include <optional>
#include <string>
#include <vector>

namespace atirma::console {

/// The boat's parameters: their values as the boat confirmed them, and those that were asked for here. Pure.
class parameter_book {
public:
    parameter_book();

    /// The boat reports its settings.
    void on_settings(const configuration& result, utc_time now);
    /// A telecommand is given here; one that sets or reads no parameter is ignored.
    void on_asked(std::uint32_t id, const boat_command& command);
    /// A telecommand is over; one that was not given here is ignored.
    void on_settled(std::uint32_t id, command_phase phase, std::optional<float> value, const std::string& text,
                    utc_time now);
    /// In the order of their numbers.
    const std::vector<parameter_view>& view() const noexcept { return parameters_; }

private:
    parameter_view* find(parameter_id id);

    std::vector<parameter_view> parameters_;
    std::map<std::uint32_t, parameter_id> open_; ///< telecommands that are not over
};

} // namespace atirma::console
