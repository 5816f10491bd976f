#include <ise/service/dispatcher.hpp>

#include <ise/core/limits.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace ise {

result<void> dispatcher::check_name(const std::string& name) const {
    bool good = !name.empty() && name.size() <= limit::service_name_bytes &&
                std::ranges::all_of(name, [](unsigned char letter) {
                    return (letter >= 'a' && letter <= 'z') || (letter >= 'A' && letter <= 'Z') ||
                           (letter >= '0' && letter <= '9') || letter == '_' || letter == '.' || letter == '-' ||
                           letter == '/';
                });
    if (!good)
        return failure(errc::invalid_argument,
                       fmt::format("'{}' is not a name of a service: up to {} letters, digits, '_', '.', '-' and '/'",
                                   name, limit::service_name_bytes));
    if (calls_.contains(name) || publications_.contains(name))
        return failure(errc::invalid_argument, fmt::format("the service '{}' is provided already", name));
    return {};
}

result<void> dispatcher::add(std::shared_ptr<call_service> service) {
    auto good = check_name(service->name());
    if (!good) return good;
    book_.add_own(service->types());
    auto name = service->name();
    calls_.emplace(std::move(name), std::move(service));
    return good;
}

result<void> dispatcher::add(std::shared_ptr<publication_core> publication) {
    auto good = check_name(publication->name());
    if (!good) return good;
    book_.add_own(publication->types());
    auto name = publication->name();
    publications_.emplace(std::move(name), std::move(publication));
    return good;
}

// Ending a subscription calls the user back, who may remove services, too.
void dispatcher::remove(const std::string& name) {
    if (auto removed = calls_.extract(name)) removed.mapped()->stop();
    if (auto removed = publications_.extract(name))
        removed.mapped()->stop(failure(errc::no_such_service, fmt::format("'{}' is not published any more", name)));
}

void dispatcher::declare_required(const std::string& name, const packet_types& types) {
    required_.emplace(name, &types);
}

std::shared_ptr<call_service> dispatcher::find_calls(std::string_view name) const {
    auto found = calls_.find(name);
    return found == calls_.end() ? nullptr : found->second;
}

std::shared_ptr<publication_core> dispatcher::find_publication(std::string_view name) const {
    auto found = publications_.find(name);
    return found == publications_.end() ? nullptr : found->second;
}

failure dispatcher::no_calls(std::string_view name) const {
    return {errc::no_such_service, find_publication(name)
                                       ? fmt::format("'{}' is a subscription, not a request-response service", name)
                                       : fmt::format("there is no service '{}'", name)};
}

failure dispatcher::no_publication(std::string_view name) const {
    return {errc::no_such_service, find_calls(name)
                                       ? fmt::format("'{}' is a request-response service, not a subscription", name)
                                       : fmt::format("there is no service '{}'", name)};
}

std::vector<service_description> dispatcher::describe() const {
    std::vector<service_description> all;
    for (const auto& [name, service] : calls_)
        all.push_back({name, service_kind::request_response, true, &service->types()});
    for (const auto& [name, publication] : publications_)
        all.push_back({name, service_kind::subscription, true, &publication->types()});
    for (const auto& [name, types] : required_) all.push_back({name, types->kind, false, types});
    return all;
}

void dispatcher::stop() {
    for (auto& [name, service] : calls_) service->stop();
    // Subscribers are not told that a service has ended, which it has not: they wait for its next provider.
    auto all = publications_; // as above
    for (auto& [name, publication] : all) publication->let_go();
}

} // namespace ise
