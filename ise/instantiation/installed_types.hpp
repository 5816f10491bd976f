#pragma once
#include <ise/instantiation/catalogue.hpp>
#include <ise/instantiation/server_context.hpp>

#include <optional>
#include <string>
#include <vector>

namespace ise::instantiation {

/// The component types of the programs in the server's folder, read again when those have changed: installing a program
/// is enough.
class installed_types {
public:
    explicit installed_types(server_context& here) : here_(here) {}

    /// Asks every program of the folder what it has, if one is new, or a problem may be over. Cancellation: terminal;
    /// what was known before stays.
    task<> refresh();
    /// All of them, and the problems, after a refresh. Cancellation: as `refresh`.
    task<types_response> describe();
    /// Throws what catalogue::plan gives as an error, after a refresh. Cancellation: as `refresh`.
    task<launch_plan> plan(start_request request);
    /// As last read.
    const catalogue& known() const noexcept { return catalogue_; }

private:
    server_context& here_;
    catalogue catalogue_;
    std::optional<time_point> read_at_;
    bool reading_ = false;
    std::vector<program_file> programs_; // that the catalogue was read from
};

} // namespace ise::instantiation
