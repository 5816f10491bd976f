#pragma once
#include <ise/instantiation/instance_table.hpp>
#include <ise/instantiation/saved_state.hpp>

#include <string>

namespace ise::instantiation {

/// Writes down what the next instantiation server must know, and reads what the last one wrote.
class state_keeper {
public:
    state_keeper(server_context& here, const instance_table& table) : here_(here), table_(table) {}

    /// Throws errc::overloaded where the state, with this request more, would be too large to be kept.
    void check_room(const start_request& more) const;
    /// The whole table goes to the disk, once `begin` was called. An error is logged, too.
    result<void> try_save();
    void save() { [[maybe_unused]] auto logged = try_save(); }
    /// Whether the table is on the disk: the outcome of the last save or, if that failed, of another one.
    result<void> saved() { return kept_ ? kept_ : try_save(); }
    /// Empty where there is none, or where it is malformed, which is logged. Throws errc::io_failed if the disk fails.
    saved_state load();
    /// The table holds all that was loaded. It is saved now, and on each change from now on; until then the former one
    /// stays on the disk, for the server after a crash.
    void begin();

private:
    saved_state now() const;
    std::string file() const { return here_.options.state_folder + "/state.json"; }

    server_context& here_;
    const instance_table& table_;
    bool began_ = false;
    result<void> kept_; // of the last save
};

} // namespace ise::instantiation
