#pragma once
#include <ise/component/parameter.hpp>
#include <ise/session/contract.hpp>

#include <string>
#include <vector>

/// What a component that was started with parameters tells of them, whoever asks. Packets: fields are only ever
/// appended.
namespace ise {

/// A parameter, and what it is now.
struct parameter_info {
    parameter about;
    std::vector<std::string> values; ///< one, or of a parameter that may be given several times any number
};

struct parameters_request {
    std::vector<std::string> names; ///< none: all
};

struct parameters_response {
    std::vector<parameter_info> parameters; ///< in the order of their declaration
};

struct parameter_setting {
    std::string name;
    std::string value;
};

/// All of them are changed, or none.
struct change_parameters_request {
    std::vector<parameter_setting> settings;
};

/// errc::refused names the parameters that there are.
inline constexpr request_response<parameters_request, parameters_response> parameters_service{"ise.parameters"};
/// Completes when the component has taken the change over; the response tells how they are now. errc::refused: no such
/// parameter, none that may be changed, a value that is not allowed, with what is; or what the component itself has
/// against it.
inline constexpr request_response<change_parameters_request, parameters_response> change_parameters_service{
    "ise.change_parameters"};
/// The parameters that were changed, with their new values, at each change.
inline constexpr subscription<parameters_response> parameter_changes_service{"ise.parameter_changes"};

} // namespace ise
