#pragma once
#include <ise/call/call_service.hpp>
#include <ise/core/result.hpp>
#include <ise/session/contract.hpp>
#include <ise/session/schema_cache.hpp>
#include <ise/subscription/publication_core.hpp>

#include <map>
#include <memory>
#include <string>
#include <vector>

namespace ise {

/// What a component tells about one of its services.
struct service_description {
    std::string name;
    service_kind kind{};
    bool provided = true; ///< else required
    const packet_types* types = nullptr;
};

/// The services of a component by name.
class dispatcher final : public call_directory, public publication_directory {
public:
    /// `book` learns the schemas of what is provided, to answer for them.
    explicit dispatcher(schema_cache& book) : book_(book) {}

    /// errc::invalid_argument if the name is taken or no name: letters, digits, `_`, `.`, `-`, `/`.
    result<void> add(std::shared_ptr<call_service> service);
    result<void> add(std::shared_ptr<publication_core> publication);
    void remove(const std::string& name);
    void declare_required(const std::string& name, const packet_types& types);

    std::shared_ptr<call_service> find_calls(std::string_view name) const override;
    failure no_calls(std::string_view name) const override;
    std::shared_ptr<publication_core> find_publication(std::string_view name) const override;
    failure no_publication(std::string_view name) const override;
    /// All, provided first; the names of ISE's own services begin with "ise.".
    std::vector<service_description> describe() const;

    /// Ends what is being served; nothing new begins.
    void stop();

private:
    result<void> check_name(const std::string& name) const;

    schema_cache& book_;
    std::map<std::string, std::shared_ptr<call_service>, std::less<>> calls_;
    std::map<std::string, std::shared_ptr<publication_core>, std::less<>> publications_;
    std::map<std::string, const packet_types*, std::less<>> required_;
};

} // namespace ise
