#pragma once
#include <ise/core/environment.hpp>

#include <cstdint>
#include <span>
#include <string>
#include <thread>
#include <vector>

// Other questions of the environment to the operating system: linux/, windows/.
namespace ise::real {

process_identity this_process();
void draw_random(std::span<std::uint64_t> into); ///< from the system's generator, for what must not be guessed
time_point recent_time();                        ///< as `environment::recently`
std::vector<std::string> interface_addresses();
void name_thread(std::thread& thread, const std::string& name); ///< for people: a debugger, the system's tools

} // namespace ise::real
