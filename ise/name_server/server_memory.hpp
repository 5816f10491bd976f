#pragma once
#include <ise/core/environment.hpp>
#include <ise/name_server/registry.hpp>

#include <optional>
#include <string>

namespace ise {

/// Where a name server keeps what the next one has to know: a secret that proves its grants, and a bound of its epochs.
class server_memory {
public:
    virtual ~server_memory() = default;

    /// Of the server before; nothing: there was none. Errors: errc::io_failed, errc::unauthorized, errc::malformed.
    virtual result<std::optional<registry_memory>> load() = 0;
    /// Replaces it, whole or not at all. Errors: errc::io_failed.
    virtual result<void> keep(const registry_memory& what) = 0;
};

/// A small file, of one name server and readable by its user only.
class state_file final : public server_memory {
public:
    /// `env` outlives it.
    state_file(environment& env, std::string path) : env_(env), path_(std::move(path)) {}

    /// Whether there is a state that can be read, or can be one.
    result<void> probe();
    /// errc::unauthorized where others can read or replace the file.
    result<std::optional<registry_memory>> load() override;
    /// Makes the folders that are missing.
    result<void> keep(const registry_memory& what) override;

private:
    environment& env_;
    std::string path_;
};

} // namespace ise
