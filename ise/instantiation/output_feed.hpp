#pragma once
#include <ise/instantiation/instance_table.hpp>

#include <cstdint>
#include <map>
#include <memory>
#include <string>

namespace ise::instantiation {

/// What instances print: looks at their output files again and again, and gives what is new to those who follow it.
class output_feed {
public:
    /// From now on it provides the service, and looks.
    output_feed(server_context& here, const instance_table& table);

    void stop() { look_->disarm(); }

private:
    void look();

    server_context& here_;
    const instance_table& table_;
    std::map<std::uint64_t, std::string> followers_; // by number: the path of an instance
    publication<std::remove_const_t<decltype(services::output)>> output_;
    std::unique_ptr<timer> look_;
};

} // namespace ise::instantiation
