#pragma once
#include "hosting.hpp"

#include <ise/core/log.hpp>

#include <functional>
#include <string>
#include <vector>

namespace atirma {

/// `atirma replay`.
struct replay_request {
    std::string file;
    std::vector<std::string> ignored, only;
    std::string out;
    ise::log_level level = ise::log_level::warning;
};

/// Replays a recording into components on the virtual clock and prints what came of it by `print`. Returns whether
/// they did what the recording has. Throws the errors of `ise::replay_world::play`.
bool replay(const replay_request& what, const std::vector<hosted>& components,
            const std::function<void(const std::string&)>& print);

} // namespace atirma
