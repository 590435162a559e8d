#include "help_pages.h"

#include <fmt/format.h>
#include <raydix/files.h>
#include <raydix/version.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "option_checks.h"

namespace raydix::cli {
namespace {

struct Head {
    const char* name;
    std::vector<std::string_view> options;
};
const std::array<Head, 4>& heads() {
    static const std::array<Head, 4> all{
        {{"Scene", {"--cameras", "--flatten", "--seed", "--strict"}},
         {"Rays",
          {"--rays",    "--mode",      "--kernel", "--machine",     "--camera", "--size",
           "--samples", "--ao-radius", "--path",   "--isa",         "--view",   "--eye",
           "--target",  "--up",        "--fov",    "--launch-rays", "--sample", "--sweep-sample",
           "--error",   "--width",     "--memory", "--any"}},
         {"Output",
          {"--json", "--quiet", "--output", "--out", "--hits", "--save-rays", "--explain"}},
         {"Run", {"--threads", "--repeat", "--max-result-bytes", "--resume", "--state"}}}};
    return all;
}

std::vector<CLI::App*> commands_of(CLI::App& app) {
    return app.get_subcommands(std::function<bool(CLI::App*)>());
}

/// Of a command, as a user types it behind the program's name: "bench traversal".
std::string path_of(const CLI::App& command) {
    const CLI::App* parent = command.get_parent();
    if (parent == nullptr) return "";
    const std::string before = path_of(*parent);
    return before.empty() ? command.get_name() : before + " " + command.get_name();
}

void for_each_command(CLI::App& app, const std::function<void(CLI::App&)>& visit) {
    visit(app);
    for (CLI::App* command : commands_of(app)) for_each_command(*command, visit);
}

struct OptionWords {
    std::vector<std::string> names;    // with their dashes; of a positional none
    std::string value;                 // "TEXT", "INT"; empty: a flag
    std::vector<std::string> choices;  // if the value is one of a list
    std::string text;
    std::string usual;
    std::string head;
    std::string positional;
};

OptionWords words_of(const CLI::Option& option) {
    OptionWords words;
    for (const std::string& name : option.get_snames()) words.names.push_back("-" + name);
    for (const std::string& name : option.get_lnames()) words.names.push_back("--" + name);
    if (option.get_expected_max() != 0 && option.get_type_size() != 0) {
        const std::string type = option.get_type_name();
        words.value = type.substr(0, type.find_first_of(":{ ["));
        const std::size_t open = type.find('{'), close = type.find('}');
        if (open != std::string::npos && close != std::string::npos)
            words.choices = CLI::detail::split(type.substr(open + 1, close - open - 1), ',');
    }
    words.text = option.get_description();
    words.usual = option.get_default_str();
    words.head = option.get_group();
    if (words.names.empty()) words.positional = option.get_name(true);
    return words;
}

std::vector<OptionWords> options_of(CLI::App& command, bool positional) {
    std::vector<OptionWords> all;
    for (const CLI::Option* option : command.get_options()) {
        OptionWords words = words_of(*option);
        if (words.names.empty() == positional) all.push_back(std::move(words));
    }
    return all;
}

/// Names of commands and options hold nothing that a shell reads otherwise; texts may.
std::string shell_word(std::string_view text) {
    std::string result;
    for (const char c : text) result += c == '\'' ? std::string("'\\''") : std::string(1, c);
    return "'" + result + "'";
}

/// What completes a value: "*" is any file.
std::string choices_of(const OptionWords& option) {
    return option.choices.empty() ? "*" : fmt::format("{}", fmt::join(option.choices, " "));
}

std::string bash_script(CLI::App& app) {
    std::string paths, values, words;
    for_each_command(app, [&](CLI::App& command) {
        const std::string path = path_of(command);
        std::vector<std::string> here;  // what may stand here
        for (const CLI::App* below : commands_of(command)) {
            here.push_back(below->get_name());
            paths += fmt::format("        '{}:{}') path='{}' ;;\n", path, below->get_name(),
                                 path_of(*below));
        }
        for (const OptionWords& option : options_of(command, true))
            here.insert(here.end(), option.choices.begin(), option.choices.end());
        const int always = here.empty() ? 0 : 1;  // without a dash too
        for (const OptionWords& option : options_of(command, false)) {
            here.insert(here.end(), option.names.begin(), option.names.end());
            if (!option.value.empty())
                values += fmt::format("    '{}:{}') choices='{}' ;;\n", path,
                                      fmt::join(option.names, fmt::format("'|'{}:", path)),
                                      choices_of(option));
        }
        words +=
            fmt::format("    '{}') words='{}' always={} ;;\n", path, fmt::join(here, " "), always);
    });
    return fmt::format(R"(# bash completion of raydix: source <(raydix completion bash)
_raydix() {{
    local cur=${{COMP_WORDS[COMP_CWORD]}} prev=${{COMP_WORDS[COMP_CWORD - 1]}} path= choices= words= always=0 i
    if [[ $cur == '=' ]]; then cur=; elif [[ $prev == '=' ]]; then prev=${{COMP_WORDS[COMP_CWORD - 2]}}; fi
    for ((i = 1; i < COMP_CWORD; i++)); do
        case "$path:${{COMP_WORDS[i]}}" in
{}        esac
    done
    case "$path:$prev" in
{}    esac
    case "$path" in
{}    esac
    COMPREPLY=()
    if [[ $choices == '*' ]]; then return; fi  # a value of any kind: files, by default
    if [[ -n $choices ]]; then
        mapfile -t COMPREPLY < <(compgen -W "$choices" -- "$cur")
    elif [[ $always == 1 || $cur == -* ]]; then
        mapfile -t COMPREPLY < <(compgen -W "$words" -- "$cur")
    fi
}}
complete -o default -o bashdefault -F _raydix raydix
)",
                       paths, values, words);
}

/// Brackets and colons end the parts of a line of _arguments.
std::string zsh_text(std::string_view text) {
    std::string result;
    for (const char c : text) {
        if (c == '[' || c == ']' || c == ':' || c == '\\') result += '\\';
        result += c;
    }
    return result;
}

std::string zsh_value(const OptionWords& option) {
    if (option.value.empty()) return "";
    return option.choices.empty()
               ? fmt::format(":{}:_files", zsh_text(option.value))
               : fmt::format(":{}:({})", zsh_text(option.value), fmt::join(option.choices, " "));
}

void append_zsh(CLI::App& command, int depth, std::string& script) {
    const std::string indent(static_cast<std::size_t>(2 * depth + 2), ' ');
    const std::vector<CLI::App*> below = commands_of(command);
    if (!below.empty()) {
        script += indent + "if (( CURRENT == 2 )); then\n" + indent + "  local -a commands=(\n";
        for (const CLI::App* one : below)
            script +=
                fmt::format("{}    {}\n", indent,
                            shell_word(one->get_name() + ":" + zsh_text(one->get_description())));
        script += fmt::format(
            "{0}  )\n{0}  _describe -t commands command commands\n{0}  return\n{0}fi\n", indent);
        script += indent + "shift words; (( CURRENT-- ))\n" + indent + "case $words[1] in\n";
        for (CLI::App* one : below) {
            script += fmt::format("{}{})\n", indent, one->get_name());
            append_zsh(*one, depth + 1, script);
            script += indent + ";;\n";
        }
        script += indent + "esac\n";
        return;
    }
    script += indent + "_arguments -s";
    for (const OptionWords& option : options_of(command, false))
        for (const std::string& name : option.names)
            script += fmt::format(
                " \\\n{}  {}", indent,
                shell_word("*" + name + "[" + zsh_text(option.text) + "]" + zsh_value(option)));
    for (const OptionWords& option : options_of(command, true))
        script += fmt::format(" \\\n{}  {}", indent, shell_word("*" + zsh_value(option)));
    script += "\n";
}

std::string zsh_script(CLI::App& app) {
    std::string script =
        "#compdef raydix\n# zsh completion of raydix: raydix completion zsh "
        ">\"${fpath[1]}/_raydix\"\n_raydix() {\n";
    append_zsh(app, 0, script);
    return script +
           "}\nif [[ $zsh_eval_context[-1] == loadautofunc ]]; then _raydix \"$@\"; else compdef "
           "_raydix raydix; fi\n";
}

std::string fish_script(CLI::App& app) {
    std::string script = "# fish completion of raydix: raydix completion fish | source\n";
    for_each_command(app, [&](CLI::App& command) {
        std::string condition;
        for (const CLI::App* at = &command; at->get_parent() != nullptr; at = at->get_parent())
            condition = "__fish_seen_subcommand_from " + at->get_name() +
                        (condition.empty() ? "" : "; and " + condition);
        std::vector<std::string> below;
        for (const CLI::App* one : commands_of(command)) below.push_back(one->get_name());
        const std::string none_yet =
            below.empty()
                ? condition
                : (condition.empty() ? "" : condition + "; and ") +
                      fmt::format("not __fish_seen_subcommand_from {}", fmt::join(below, " "));
        for (const CLI::App* one : commands_of(command))
            script += fmt::format("complete -c raydix -n {} -f -a {} -d {}\n", shell_word(none_yet),
                                  one->get_name(), shell_word(one->get_description()));
        for (const OptionWords& option : options_of(command, false)) {
            script += fmt::format("complete -c raydix -n {}", shell_word(none_yet));
            for (const std::string& name : option.names)
                script +=
                    name.starts_with("--") ? " -l " + name.substr(2) : " -s " + name.substr(1);
            if (!option.choices.empty())
                script += fmt::format(
                    " -x -a {}", shell_word(fmt::format("{}", fmt::join(option.choices, " "))));
            else if (!option.value.empty())
                script += " -r";
            script += fmt::format(" -d {}\n", shell_word(option.text));
        }
        for (const OptionWords& option : options_of(command, true))
            if (!option.choices.empty())
                script +=
                    fmt::format("complete -c raydix -n {} -f -a {}\n", shell_word(condition),
                                shell_word(fmt::format("{}", fmt::join(option.choices, " "))));
    });
    return script;
}

/// As roff reads it: dashes stay dashes, and no line begins with a request.
std::string roff(std::string_view text) {
    std::string result;
    for (const char c : text) {
        if (c == '\\')
            result += "\\e";
        else if (c == '-')
            result += "\\-";
        else
            result += c;
    }
    return result.starts_with('.') || result.starts_with('\'') ? "\\&" + result : result;
}

void append_roff(const OptionWords& option, std::string& page) {
    page += ".TP\n";
    std::string names;
    for (const std::string& name : option.names)
        names += (names.empty() ? "" : ", ") + ("\\fB" + roff(name) + "\\fR");
    if (option.names.empty()) names = "\\fI" + roff(option.positional) + "\\fR";
    if (!option.value.empty() && !option.names.empty())
        names += " \\fI" + roff(option.value) + "\\fR";
    page += names + "\n" + roff(option.text) + "\n";
    if (!option.choices.empty())
        page += fmt::format(".br\nOne of {}.\n",
                            roff(fmt::format("{}", fmt::join(option.choices, ", "))));
    if (!option.usual.empty()) page += fmt::format(".br\nWithout it: {}\n", roff(option.usual));
}

/// Text as it is, line by line.
void append_lines(const std::string& text, std::string& page) {
    page += ".nf\n";
    for (const std::string& line : CLI::detail::split(text, '\n')) page += roff(line) + "\n";
    page += ".fi\n";
}

/// "raydix-bench-traversal"
std::string page_name(const CLI::App& command) {
    std::string path = path_of(command);
    std::ranges::replace(path, ' ', '-');
    return path.empty() ? "raydix" : "raydix-" + path;
}

std::string man_page(CLI::App& command) {
    const std::string path = path_of(command), title = page_name(command);
    std::string upper = title;
    std::ranges::transform(upper, upper.begin(), [](char c) {
        return c >= 'a' && c <= 'z' ? static_cast<char>(c - 'a' + 'A') : c;
    });
    std::string page = fmt::format(
        ".TH {} 1 \"\" \"raydix {}\" \"raydix\"\n.SH NAME\n{} \\- {}\n.SH SYNOPSIS\n.B raydix{}\n",
        roff(upper), raydix::version, roff(title), roff(command.get_description()),
        path.empty() ? "" : " " + roff(path));
    const std::vector<CLI::App*> below = commands_of(command);
    const std::vector<OptionWords> positionals = options_of(command, true),
                                   options = options_of(command, false);
    page += fmt::format("[\\fIOPTIONS\\fR]{}", below.empty() ? "" : " \\fICOMMAND\\fR");
    for (const OptionWords& one : positionals) page += " \\fI" + roff(one.positional) + "\\fR";
    page += "\n";
    if (!positionals.empty()) page += ".SH ARGUMENTS\n";
    for (const OptionWords& one : positionals) append_roff(one, page);
    if (!below.empty()) page += ".SH COMMANDS\n";
    for (const CLI::App* one : below)
        page += fmt::format(".TP\n\\fB{}\\fR\n{}\n", roff(one->get_name()),
                            roff(one->get_description()));
    std::vector<std::string> seen;
    for (const OptionWords& first : options) {
        if (std::ranges::find(seen, first.head) != seen.end()) continue;
        seen.push_back(first.head);
        page += fmt::format(".SH {}\n",
                            roff(first.head == "Options" ? "OPTIONS" : "OPTIONS: " + first.head));
        for (const OptionWords& option : options)
            if (option.head == first.head) append_roff(option, page);
    }
    // Of a program beside this one, which alone knows its options.
    const std::string other = command.get_footer();  // with a line's end of its own
    if (other.size() > 1) {
        page += ".SH OPTIONS\n";
        append_lines(other, page);
    }
    page +=
        ".SH EXIT STATUS\n0: done. 1: the input or the machine is at fault; one line on standard "
        "error says what and where. 2: usage.\n";
    return page;
}

CLI::App& command_at(CLI::App& app, const std::vector<std::string>& names) {
    CLI::App* at = &app;
    for (const std::string& name : names) {
        const std::vector<CLI::App*> below = commands_of(*at);
        const auto found = std::ranges::find_if(
            below, [&](const CLI::App* one) { return one->get_name() == name; });
        if (found == below.end())
            throw CLI::ValidationError("COMMAND", "'" + name + "' is not a command" +
                                                      (at == &app ? "" : " of " + path_of(*at)));
        at = *found;
    }
    return *at;
}

}  // namespace

void group_options(CLI::App& app) {
    for_each_command(app, [](CLI::App& command) {
        for (const Head& head : heads())
            for (const std::string_view name : head.options)
                if (CLI::Option* option = command.get_option_no_throw(std::string(name));
                    option != nullptr && option->get_group() == "Options")
                    option->group(head.name);
    });
}

void add_completion_command(CLI::App& app) {
    CLI::App* command = app.add_subcommand(
        "completion", "Print a script that completes commands and options in a shell");
    auto shell = std::make_shared<std::string>();
    command->add_option("SHELL", *shell, "The shell")
        ->required()
        ->check(CLI::IsMember({"bash", "zsh", "fish"}));
    command->callback([&app, shell] {
        fmt::print("{}", *shell == "bash"  ? bash_script(app)
                         : *shell == "zsh" ? zsh_script(app)
                                           : fish_script(app));
    });
}

void add_man_command(CLI::App& app) {
    CLI::App* command = app.add_subcommand(
        "man", "Print the manual page of a command: raydix man trace | man -l -");
    auto names = std::make_shared<std::vector<std::string>>();
    auto folder = std::make_shared<std::string>();
    command->add_option("COMMAND", *names, "The command; none: the program");
    command->add_option("--folder", *folder, "Write the pages of all commands into FOLDER instead")
        ->check(file_name())
        ->type_name("FOLDER");
    command->callback([&app, names, folder] {
        if (folder->empty()) return fmt::print("{}", man_page(command_at(app, *names)));
        for_each_command(app, [&](CLI::App& one) {
            const std::string page = man_page(one);
            write_file(std::filesystem::path(*folder) / (page_name(one) + ".1"),
                       std::as_bytes(std::span(page)));
        });
    });
}

}  // namespace raydix::cli
