#pragma once
#include <ise/core/readable.hpp>

#include <CLI/CLI.hpp>

#include <memory>
#include <string>

/// Help in lines that fit a terminal. Set on an app before its subcommands, which inherit it.
class wrapped_help : public CLI::Formatter {
public:
    std::string make_help(const CLI::App* app, std::string name, CLI::AppFormatMode mode) const override {
        return ise::wrapped(CLI::Formatter::make_help(app, std::move(name), mode));
    }
};
